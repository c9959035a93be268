// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>

#include "base/contained_path.h"
#include "base/error.h"
#include "base/posix_file.h"
#include "store/archive_index.h"
#include "store/frame_buffers.h"
#include "store/jpegxl/packed_frame.h"
#include "store/rotten_frame.h"
#include "store/temporal/temporal_frame.h"

namespace raystage::store {

/// The frames of an archive as they are stored, each checked once against its XXH3. Frames that
/// were lost with the end of a closed archive keep their records and numbers, and count as rotten:
/// a timeline that was made before still fits, and whoever needs such a frame is told. Const
/// members are thread-safe.
struct IndexedArchive {
  IndexedArchive() = default;
  /// Opens the file; `index` is still empty.
  IndexedArchive(const ContainedPath& archive, std::shared_ptr<FrameBuffers> with_buffers)
      : path(archive.path()), file(archive), buffers(std::move(with_buffers)) {}

  /// Lists the lost frames of `index` among the others, once.
  void include_lost();
  /// Marks every frame as not checked yet.
  void forget_checks();

  const FrameRecord& record(int frame) const;
  bool may_have_packed_frames() const { return index.description.codec == FrameCodec::kPacked; }
  bool is_lost(int frame) const { return integrity[frame] == Integrity::kLost; }
  bool is_known_intact(int frame) const { return integrity[frame] == Integrity::kIntact; }
  bool has_recorded_hash(int frame, const FrameBytes& bytes) const;
  void mark_rotten(int frame) const { integrity[frame] = Integrity::kRotten; }

  /// Returns the bytes of a frame as they are in the file. Throws Error (bad input) if they cannot
  /// be read.
  FrameBytes read(int frame) const;
  /// Returns the stored bytes of a frame; none if they are not the recorded ones.
  std::optional<FrameBytes> read_intact(int frame) const;
  /// Returns what a packed frame states; nullopt of a JPEG. Reads the beginning of the frame.
  std::optional<JpegFixity> packed_fixity(int frame) const;
  /// Returns what a temporal frame states; nullopt of others. Reads the beginning of the frame.
  std::optional<FrameLink> link_of(int frame) const;

  RottenFrame rotten_frame(int frame) const;

  std::filesystem::path path;
  std::optional<InputFile> file;  // nullopt: on another host
  std::shared_ptr<FrameBuffers> buffers;
  ArchiveIndex index;

 private:
  enum class Integrity : std::uint8_t { kUnchecked, kIntact, kRotten, kLost };

  /// Returns the first bytes of a frame; nullopt if it has fewer, or is lost.
  template <std::size_t kBytes>
  std::optional<std::array<std::byte, kBytes>> start_of(int frame) const;
  Error unreadable(int frame) const;

  std::unique_ptr<std::atomic<Integrity>[]> integrity;  // of each frame
};

}  // namespace raystage::store
