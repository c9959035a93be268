// SPDX-License-Identifier: Apache-2.0
// Follows the links of video frames (store/temporal/temporal_frame.h). Within an archive each frame
// refers to the one before it. Across cameras a group is of one instant: frames are taken in slices
// of time, and in each by their position in the group. Links are read from the frames and not
// inferred from an archive's header, which may be damaged. Cost: the first bytes of each frame;
// memory for the frames of a slice.
#include "store/fixity/undecodable_frames.h"

#include <algorithm>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <utility>

#include "base/contained_path.h"
#include "base/mapped_file.h"
#include "store/temporal/temporal_frame.h"

namespace raystage::store {
namespace {

constexpr Nanoseconds kSlice = 60 * kNanosecondsPerSecond;
constexpr Nanoseconds kInstant = 2 * kNanosecondsPerSecond;  // much longer than an instant lasts

struct LinkedFrame {
  int camera = 0;
  AffectedFrame frame;
  FrameLink link;
  std::uint64_t hash = 0;
};

/// Reads the links of an archive's frames.
class LinkReader {
 public:
  LinkReader(const Take& take, int camera, const FrameTimes& damaged)
      : camera_(camera), frames_(take.archive(camera).frames()) {
    const auto index = static_cast<std::size_t>(camera);
    file_ = std::make_unique<MappedFile>(take.file(take.document().cameras[index].archive));
    file_->expect(MappedFile::Access::kSparse);
    if (index < damaged.size()) damaged_ = &damaged[index];
  }

  std::size_t count() const { return frames_.size(); }
  Nanoseconds time(std::size_t number) const { return frames_[number].time_ns; }
  /// Returns the number of the first frame at or after a time.
  std::size_t first_from(Nanoseconds time) const {
    const auto found = std::ranges::lower_bound(frames_, time, {}, &FrameRecord::time_ns);
    return static_cast<std::size_t>(found - frames_.begin());
  }
  /// Returns a frame with its link; nullopt if it is damaged or lost, or no video.
  std::optional<LinkedFrame> read(std::size_t number) const {
    const FrameRecord& record = frames_[number];
    const std::uint64_t end = file_->bytes().size();
    const bool is_damaged = damaged_ != nullptr && damaged_->contains(record.time_ns);
    if (is_damaged || record.offset > end || record.size > end - record.offset) return std::nullopt;
    const auto bytes = file_->bytes().subspan(static_cast<std::size_t>(record.offset), record.size);
    const auto start = bytes.first(std::min(bytes.size(), kFrameLinkBytes));
    const auto link = file_->can_read(start) ? read_frame_link(start) : std::nullopt;
    if (!link || (record.xxh3 == 0 && !file_->can_read(bytes))) return std::nullopt;
    const std::uint64_t hash = record.xxh3 != 0 ? record.xxh3 : hash_of_stored(bytes);
    return LinkedFrame{camera_, {static_cast<std::int64_t>(number), record.time_ns}, *link, hash};
  }

 private:
  int camera_;
  std::span<const FrameRecord> frames_;
  std::unique_ptr<MappedFile> file_;
  const std::set<Nanoseconds>* damaged_ = nullptr;
};

/// Within an archive.
std::vector<AffectedFrame> undecodable_frames_of(const LinkReader& archive,
                                                 const std::stop_token& stop) {
  std::vector<AffectedFrame> undecodable;
  std::optional<LinkedFrame> last;  // if it can be decoded
  for (std::size_t i = 0; i < archive.count() && !stop.stop_requested(); ++i) {
    const auto frame = archive.read(i);
    const bool continues = frame && last && frame->link.position == last->link.position + 1 &&
                           frame->link.previous == last->hash;
    if (frame && frame->link.position > 0 && !continues) {
      undecodable.push_back(frame->frame);
      last.reset();
    } else {
      last = frame;
    }
  }
  return undecodable;
}

/// Across cameras: adds those of a slice of time.
void add_undecodable_frames(const std::vector<LinkReader>& archives, Nanoseconds begin,
                            std::vector<std::vector<AffectedFrame>>& undecodable) {
  std::vector<LinkedFrame> frames;
  for (const LinkReader& archive : archives) {
    const std::size_t end = archive.first_from(begin + kSlice + kInstant);
    for (std::size_t i = archive.first_from(begin - kInstant); i < end; ++i) {
      if (auto frame = archive.read(i)) frames.push_back(*frame);
    }
  }
  std::ranges::stable_sort(frames, {}, [](const LinkedFrame& f) { return f.link.position; });
  std::set<std::pair<std::uint32_t, std::uint64_t>> decodable;  // position and hash
  for (const LinkedFrame& frame : frames) {
    const FrameLink& link = frame.link;
    if (link.position == 0 || decodable.contains({link.position - 1, link.previous})) {
      decodable.emplace(link.position, frame.hash);
    } else if (frame.frame.time_ns >= begin && frame.frame.time_ns < begin + kSlice) {
      undecodable[static_cast<std::size_t>(frame.camera)].push_back(frame.frame);
    }
  }
}

/// Returns the time of the first frame at or after a time; nullopt if there is none.
std::optional<Nanoseconds> next_frame(const std::vector<LinkReader>& archives, Nanoseconds from) {
  std::optional<Nanoseconds> first;
  for (const LinkReader& archive : archives) {
    const std::size_t number = archive.first_from(from);
    if (number == archive.count()) continue;
    first = std::min(first.value_or(archive.time(number)), archive.time(number));
  }
  return first;
}

}  // namespace

std::vector<std::vector<AffectedFrame>> find_undecodable_frames(const Take& take,
                                                                const FrameTimes& damaged,
                                                                const std::stop_token& stop) {
  std::vector<std::vector<AffectedFrame>> undecodable(
      static_cast<std::size_t>(take.camera_count()));
  std::vector<LinkReader> archives;
  bool refer_to_cameras = false;
  for (int camera = 0; camera < take.camera_count(); ++camera) {
    const auto index = static_cast<std::size_t>(camera);
    if (!exists(take.file(take.document().cameras[index].archive))) continue;
    const FrameCodec codec = take.archive(camera).description().codec;
    refer_to_cameras = refer_to_cameras || refers_to_cameras(codec);
    if (!refer_to_cameras && is_temporal(codec)) {
      undecodable[index] = undecodable_frames_of({take, camera, damaged}, stop);
    }
  }
  if (!refer_to_cameras) return undecodable;
  for (int camera = 0; camera < take.camera_count(); ++camera) {
    const auto index = static_cast<std::size_t>(camera);
    undecodable[index].clear();
    if (!exists(take.file(take.document().cameras[index].archive))) continue;
    archives.emplace_back(take, camera, damaged);
  }
  // Times may be far apart: slices without frames are left out.
  for (auto begin = next_frame(archives, 0); begin && !stop.stop_requested();
       begin = next_frame(archives, *begin + kSlice)) {
    add_undecodable_frames(archives, *begin, undecodable);
  }
  for (std::vector<AffectedFrame>& frames : undecodable) {
    std::ranges::sort(frames, {}, &AffectedFrame::number);
  }
  return undecodable;
}

}  // namespace raystage::store
