// SPDX-License-Identifier: Apache-2.0
#include "store/fixity/decoded_frame_check.h"

#include <fmt/format.h>

#include <utility>

#include "base/error.h"
#include "store/jpegxl/packed_frame.h"
#include "store/temporal/temporal_frame.h"

namespace raystage::store {

// Returns whether bytes that follow in the archive have the XXH3 of their record, which is looked
// for from a slot of the journal on. Where it is lost, the link to the frame before decides.
bool DecodedFrameCheck::is_as_recorded(const matroska::FoundFrame& frame, std::size_t& slot,
                                       std::uint32_t version) const {
  if (!pair_.journal) return true;
  const std::size_t step = journal::record_bytes(version);
  for (; slot + step <= pair_.journal->size(); slot += step) {
    const auto record = journal::decode_record(pair_.journal->subspan(slot, step), version);
    if (!record || record->status != FrameStatus::kStored || record->offset < frame.offset)
      continue;
    if (record->offset > frame.offset || record->xxh3 == 0) return true;
    return record->xxh3 == hash_of_stored(pair_.archive.subspan(frame.offset, frame.size));
  }
  return true;
}

// Decodes the longest beginning of a group that can be decoded.
std::vector<std::vector<std::byte>> DecodedFrameCheck::decode_beginning(
    std::span<const Bytes> frames) {
  const auto decode = [&](std::size_t count) {
    return groups_.decode(video_codec_of(codec_),
                          {pair_.description.width, pair_.description.height}, frames.first(count),
                          pair_.archive_name);
  };
  std::vector<std::vector<std::byte>> pictures;
  std::size_t most = frames.size() + 1;  // so many cannot be decoded
  for (std::size_t count = frames.size(); count > pictures.size();) {
    try {
      pictures = decode(count);
    } catch (const Error& error) {
      if (error.exit_code() != ExitCode::kBadInput || count == 1) throw;
      most = count;
    }
    count = (pictures.size() + most) / 2;
  }
  return pictures;
}

// Returns the picture of a temporal frame as a JPEG. Decodes a group with its first frame.
std::vector<std::byte> DecodedFrameCheck::decode_temporal(const JournaledFrame& frame,
                                                          std::uint32_t position) {
  const auto refuse = [&](const char* what) {
    return Error::bad_input(what, pair_.archive_name, "Run `raystage repair` with a copy");
  };
  // Where an earlier run ended within a group, the frames before are decoded again.
  if (position == 0 || skipped_start_) {
    const FrameRecord first = position == 0 ? frame.record : skipped_start_->record;
    std::size_t slot = position == 0 ? frame.slot : skipped_start_->slot;
    skipped_start_.reset();
    group_.clear();
    const auto start = static_cast<std::size_t>(first.offset);
    std::vector<Bytes> frames{pair_.archive.subspan(start, first.size)};
    std::uint64_t bytes_of_group = first.size;
    for (std::size_t end = start + first.size; frames.size() < kMaxGroupFrames;) {
      const auto next = matroska::parse_cluster(pair_.archive, end);
      if (!next) break;
      const Bytes bytes = pair_.archive.subspan(next->offset, next->size);
      const auto link = read_frame_link(bytes);
      bytes_of_group += next->size;
      if (!link || link->position != frames.size() ||
          link->previous != hash_of_stored(frames.back()) || bytes_of_group > kMaxGroupBytes ||
          !is_as_recorded(*next, slot, frame.journal_version)) {
        break;
      }
      frames.push_back(bytes);
      end = next->offset + next->size;
    }
    group_ = decode_beginning(frames);
  }
  if (position >= group_.size() || group_[position].empty()) {
    throw refuse("it cannot be decoded, or a frame of its group before it is damaged or lost");
  }
  return std::exchange(group_[position], {});
}

std::optional<std::string> DecodedFrameCheck::problem_of(Bytes stored,
                                                         const JournaledFrame& frame) {
  if (refers_to_cameras(codec_)) return std::nullopt;
  const ArchiveWriter::Description& camera = pair_.description;
  try {
    if (codec_ == FrameCodec::kPicture) {
      // Checks the size and that samples are finite.
      pictures_.decode(stored, camera.width, camera.height, nullptr, pair_.archive_name);
      return std::nullopt;
    }
    std::vector<std::byte> unpacked;
    if (codec_ == FrameCodec::kPacked && is_jpeg_xl(stored)) {
      unpacked = packer_.unpack(stored, {camera.width, camera.height}, pair_.archive_name);
      stored = unpacked;
    }
    if (is_temporal(codec_) && read_frame_link(stored)) {
      unpacked = decode_temporal(frame, read_frame_link(stored)->position);
      stored = unpacked;
    }
    const RgbImage image = decoder_.decode(stored, pair_.archive_name);
    if (image.width == camera.width && image.height == camera.height) return std::nullopt;
    return fmt::format("a frame has {} x {} pixels, but the camera has {} x {}", image.width,
                       image.height, camera.width, camera.height);
  } catch (const Error& error) {
    if (error.exit_code() != ExitCode::kBadInput) throw;  // libjxl cannot be run
    return "a frame cannot be decoded: " + error.what_happened();
  }
}

}  // namespace raystage::store
