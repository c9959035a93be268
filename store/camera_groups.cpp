// SPDX-License-Identifier: Apache-2.0
// Finds the frames of a group in the archives of a take. A frame names the one before it by XXH3
// (store/temporal/temporal_frame.h). The journals hold the XXH3 of all frames: where a group is
// intact, the frame before is among those of its time, otherwise it is looked up in a table of all
// frames (frames_by_hash.h). Cost: a binary search per camera and frame of the group, and reading
// these.
#include "store/camera_groups.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "base/error.h"
#include "store/frames_by_hash.h"
#include "store/temporal/temporal_frame.h"

namespace raystage::store {
namespace {

/// Returns whether the frames of two archives can be in one group.
bool is_alike(const ArchiveReader& a, const ArchiveReader& b) {
  const auto &one = a.description(), &other = b.description();
  return one.codec == other.codec && one.width == other.width && one.height == other.height;
}

/// Returns the XXH3 of a frame's stored bytes; of those in the archive where the record was lost.
std::optional<std::uint64_t> hash_of(const ArchiveReader& archive, int frame) {
  const std::uint64_t recorded = archive.frames()[static_cast<std::size_t>(frame)].xxh3;
  if (recorded != 0) return recorded;
  const auto bytes = archive.intact_stored(frame);
  return bytes ? std::optional(hash_of_stored(*bytes)) : std::nullopt;
}

/// Returns the intact frame before the first of a group in reverse order, by the XXH3 that it
/// states.
std::optional<GroupMember> find_before(const TakeArchives& take, const GroupMember& member,
                                       const FrameLink& link) {
  const ArchiveReader& own = take.archive(member.camera);
  const Nanoseconds time = own.frames()[static_cast<std::size_t>(member.frame)].time_ns;
  const auto intact_member = [&](int camera, int frame) -> std::optional<GroupMember> {
    auto bytes = take.archive(camera).intact_stored(frame);
    const auto before = bytes ? read_frame_link(*bytes) : std::nullopt;
    if (!before || before->position + 1 != link.position ||
        hash_of_stored(*bytes) != link.previous) {
      return std::nullopt;
    }
    return GroupMember{camera, frame, *std::move(bytes)};
  };
  const auto is_candidate = [&](int camera) {
    const ArchiveReader* const other =
        camera == member.camera ? nullptr : readable_archive(take, camera);
    return other != nullptr && is_alike(own, *other);
  };
  for (int camera = 0; camera < take.camera_count(); ++camera) {
    if (!is_candidate(camera)) continue;
    const ArchiveReader& archive = take.archive(camera);
    const auto nearest = archive.nearest_frame(time);
    if (!nearest) continue;
    const int end = std::min(static_cast<int>(archive.frames().size()), *nearest + 2);
    for (int frame = std::max(0, *nearest - 1); frame < end; ++frame) {
      if (hash_of(archive, frame) != link.previous) continue;
      if (auto found = intact_member(camera, frame)) return found;
    }
  }
  // Frames of one XXH3 are copies of each other, unless a journal states it for many that have
  // another one.
  constexpr std::size_t kMostCopies = 16;
  const auto copies = take.frames_by_hash().find(take, link.previous);
  for (const FramesByHash::Entry& copy : copies.first(std::min(copies.size(), kMostCopies))) {
    if (!is_candidate(copy.camera)) continue;
    if (auto found = intact_member(copy.camera, copy.frame)) return found;
  }
  return std::nullopt;
}

}  // namespace

const ArchiveReader* readable_archive(const TakeArchives& take, int camera) {
  const ArchiveReader* archive = nullptr;
  try {
    archive = &take.archive(camera);
  } catch (const Error& error) {
    if (error.exit_code() != ExitCode::kBadInput) throw;
    return nullptr;
  }
  if (!archive->is_remote()) return archive;
  if (archive->records().empty()) return nullptr;  // missing, which is accepted
  throw Error::failed("frames of the take refer to camera \"" + archive->description().camera_id +
                          "\", whose archive is on another host",
                      "", "Put the take in a folder that every host can read");
}

std::vector<GroupMember> group_up_to(const TakeArchives& take, int camera, int frame) {
  std::vector<GroupMember> group;
  auto bytes = take.archive(camera).intact_stored(frame);
  if (!bytes) return {};
  std::uint64_t bytes_of_group = bytes->size();
  group.push_back({camera, frame, *std::move(bytes)});
  for (;;) {
    const auto link = read_frame_link(group.back().bytes);
    if (!link || group.size() > kMaxGroupFrames) return {};
    if (link->position == 0) break;
    auto before = find_before(take, group.back(), *link);
    if (!before) return {};
    bytes_of_group += before->bytes.size();
    if (bytes_of_group > kMaxGroupBytes) return {};
    group.push_back(*std::move(before));
  }
  std::ranges::reverse(group);
  return group;
}

void extend_group(const TakeArchives& take, std::vector<GroupMember>& group) {
  const ArchiveReader& own = take.archive(group.front().camera);
  const Nanoseconds time = own.frames()[static_cast<std::size_t>(group.front().frame)].time_ns;
  std::vector<GroupMember> others;
  std::uint64_t bytes_of_all = 0;
  for (const GroupMember& member : group) bytes_of_all += member.bytes.size();
  for (int camera = 0; camera < take.camera_count(); ++camera) {
    const ArchiveReader* const archive = readable_archive(take, camera);
    const bool is_member = std::ranges::find(group, camera, &GroupMember::camera) != group.end();
    if (is_member || archive == nullptr || !is_alike(own, *archive)) continue;
    const auto nearest = archive->nearest_frame(time);
    if (!nearest) continue;
    bytes_of_all += archive->frames()[static_cast<std::size_t>(*nearest)].size;
    if (bytes_of_all > kMaxGroupBytes) break;
    if (auto bytes = archive->intact_stored(*nearest)) {
      others.push_back({camera, *nearest, *std::move(bytes)});
    }
  }
  while (group.size() < kMaxGroupFrames) {
    const std::uint64_t last = hash_of_stored(group.back().bytes);
    const auto next = std::ranges::find_if(others, [&](const GroupMember& other) {
      const auto link = read_frame_link(other.bytes);
      return link && link->position == group.size() && link->previous == last;
    });
    if (next == others.end()) break;
    group.push_back(std::move(*next));
    others.erase(next);
  }
}

}  // namespace raystage::store
