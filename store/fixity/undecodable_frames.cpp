// SPDX-License-Identifier: Apache-2.0
// Follows the links of video frames (store/temporal/temporal_frame.h). Frames are taken by their
// position in the group, so that those to which a frame refers come before it; across cameras, the
// frames of all archives are one set. Cost: the first bytes of each frame, and a sort.
#include "store/fixity/undecodable_frames.h"

#include <algorithm>
#include <cstdint>
#include <optional>
#include <utility>

#include "base/error.h"
#include "base/mapped_file.h"
#include "store/temporal/temporal_frame.h"

namespace raystage::store {
namespace {

struct LinkedFrame {
  int camera = 0;
  AffectedFrame frame;
  FrameLink link;
  std::uint64_t hash = 0;
};

/// Appends the frames of an archive that have a link, and are not damaged themselves.
void read_links(const Take& take, int camera, const std::set<Nanoseconds>& damaged,
                std::vector<LinkedFrame>& frames) {
  const ArchiveReader& archive = take.archive(camera);
  const MappedFile file(
      take.file(take.document().cameras[static_cast<std::size_t>(camera)].archive));
  file.expect(MappedFile::Access::kSparse);
  std::int64_t number = -1;
  for (const FrameRecord& record : archive.frames()) {
    ++number;
    const std::uint64_t end = file.bytes().size();
    if (damaged.contains(record.time_ns) || record.offset > end ||
        record.size > end - record.offset) {
      continue;
    }
    const auto bytes = file.bytes().subspan(static_cast<std::size_t>(record.offset), record.size);
    const auto start = bytes.first(std::min(bytes.size(), kFrameLinkBytes));
    const auto link = file.can_read(start) ? read_frame_link(start) : std::nullopt;
    if (!link) continue;  // no video: decoded without others
    if (record.xxh3 == 0 && !file.can_read(bytes)) continue;
    const std::uint64_t hash = record.xxh3 != 0 ? record.xxh3 : hash_of_stored(bytes);
    frames.push_back({camera, {number, record.time_ns}, *link, hash});
  }
}

/// Sorts out the frames that can be decoded, and appends the others to those of their camera.
void follow_links(std::vector<LinkedFrame>& frames,
                  std::vector<std::vector<AffectedFrame>>& undecodable) {
  std::ranges::stable_sort(frames, {}, [](const LinkedFrame& f) { return f.link.position; });
  std::set<std::pair<std::uint32_t, std::uint64_t>> decodable;  // position and hash
  for (const LinkedFrame& frame : frames) {
    const FrameLink& link = frame.link;
    if (link.position == 0 || decodable.contains({link.position - 1, link.previous})) {
      decodable.emplace(link.position, frame.hash);
    } else {
      undecodable[static_cast<std::size_t>(frame.camera)].push_back(frame.frame);
    }
  }
}

}  // namespace

std::vector<std::vector<AffectedFrame>> find_undecodable_frames(const Take& take,
                                                                const FrameTimes& damaged) {
  const auto cameras = static_cast<std::size_t>(take.camera_count());
  std::vector<std::vector<AffectedFrame>> undecodable(cameras);
  std::vector<LinkedFrame> across_cameras;
  for (std::size_t i = 0; i < cameras; ++i) {
    const int camera = static_cast<int>(i);
    try {
      const FrameCodec codec = take.archive(camera).description().codec;
      if (!is_temporal(codec)) continue;
      std::vector<LinkedFrame> of_archive;
      std::vector<LinkedFrame>& frames = refers_to_cameras(codec) ? across_cameras : of_archive;
      read_links(take, camera, i < damaged.size() ? damaged[i] : std::set<Nanoseconds>(), frames);
      follow_links(of_archive, undecodable);
    } catch (const Error& error) {  // a problem of the archive itself
      if (error.exit_code() != ExitCode::kBadInput) throw;
    }
  }
  follow_links(across_cameras, undecodable);
  for (std::vector<AffectedFrame>& frames : undecodable) {
    std::ranges::sort(frames, {}, &AffectedFrame::number);
  }
  return undecodable;
}

bool has_torn_records(const Take& take) {
  for (int camera = 0; camera < take.camera_count(); ++camera) {
    try {
      const auto records = take.archive(camera).records();
      if (std::ranges::find(records, FrameStatus::kTorn, &FrameRecord::status) != records.end()) {
        return true;
      }
    } catch (const Error& error) {  // a problem of the archive itself
      if (error.exit_code() != ExitCode::kBadInput) throw;
    }
  }
  return false;
}

}  // namespace raystage::store
