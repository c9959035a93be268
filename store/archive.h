// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "schemas/time.h"

namespace raystage {

/// What became of one frame of a camera. The numbers are on disk: only append.
enum class FrameStatus : std::uint8_t {
  kStored = 0,
  kDroppedBySource = 1,  ///< the camera or its driver skipped it (a gap in its counter)
  kDroppedRamFull = 2,   ///< arrived, found no room
  kDroppedEncoder = 3,   ///< arrived, could not be encoded
  kTorn = 4,             ///< arrived incomplete
  kStartUp = 5           ///< lost while the camera started
};
const char* name_of(FrameStatus status);

/// One record of the journal (32 bytes on disk, layout in docs/formats/journal.md).
struct FrameRecord {
  Nanoseconds time_ns = 0;   ///< since the take's epoch
  std::uint64_t offset = 0;  ///< of the JPEG bytes in the archive; 0 when not stored
  std::uint32_t size = 0;    ///< of the JPEG, bytes; 0 when not stored
  FrameStatus status = FrameStatus::kStored;
  std::uint64_t xxh3 = 0;  ///< XXH3-64 of the JPEG bytes; 0 when not stored
  bool operator==(const FrameRecord&) const = default;
};

/// Writes one camera's Matroska archive and its journal: 1 ns time scale, one cluster per frame,
/// each frame whole on disk (in the page cache) when append returns. Cues, duration and sizes are
/// filled in by close(); without it the file is readable all the same.
class ArchiveWriter {
 public:
  struct Description {
    std::string camera_id;
    int width = 0, height = 0;  ///< pixels
    Nanoseconds epoch_utc = 0;  ///< of time 0, since 1970 (Matroska's DateUTC)
  };
  /// Creates both files. Throws Error (failed) when they exist already or cannot be created.
  ArchiveWriter(const std::filesystem::path& archive, const std::filesystem::path& journal,
                const Description& description);
  ~ArchiveWriter();  ///< closes; an error then is lost, so call close() where it matters
  ArchiveWriter(ArchiveWriter&&) noexcept;
  ArchiveWriter& operator=(ArchiveWriter&&) noexcept;

  /// Appends a JPEG. Times must increase, from 0 up to 104 days. Throws Error: bad input for time
  /// or empty frame, failed for the disk; after a failure the files end with the last whole frame.
  void append(std::span<const std::byte> jpeg, Nanoseconds time);
  /// Records a frame that is not there (`status` other than kStored).
  void append_missing(FrameStatus status, Nanoseconds time);
  /// Throws Error (failed) for the disk; the frames are safe and readable then all the same. Does
  /// not wait for the disk: TakeWriter::commit does, once for all.
  void close();

 private:
  struct Files;
  std::unique_ptr<Files> files_;
};

/// Reads one camera's archive. The journal is the index; where it is missing, torn or behind, the
/// Matroska file is scanned instead. A file cut at any byte gives every whole frame.
/// Const members may be called from many threads at once. The archive is mapped: if someone cuts it
/// short meanwhile, touching the lost part ends the process with SIGBUS.
class ArchiveReader {
 public:
  /// Throws Error (bad input): no Matroska file, another time scale, a journal of a future version
  /// or of another archive.
  ArchiveReader(const std::filesystem::path& archive, const std::filesystem::path& journal);
  ~ArchiveReader();
  ArchiveReader(ArchiveReader&&) noexcept;
  ArchiveReader& operator=(ArchiveReader&&) noexcept;

  /// Every record, stored or missing, by increasing time.
  std::span<const FrameRecord> records() const;
  /// The stored ones, by increasing time: "frame i" everywhere is an index into these.
  std::span<const FrameRecord> frames() const;
  /// Index of the frame whose time is nearest (the earlier at a tie), nullopt without frames.
  std::optional<int> nearest_frame(Nanoseconds time) const;

  /// The JPEG bytes of frame i, mapped from the file: valid as long as the reader.
  /// Nothing is checked but the bounds; see verify_frame.
  std::span<const std::byte> jpeg(int frame) const;
  /// Whether the bytes of frame i still have the journal's XXH3; false where it holds none.
  bool verify_frame(int frame) const;

  const ArchiveWriter::Description& description() const;
  bool was_closed() const;      ///< false: the recording ended in a crash or still runs
  std::uint64_t bytes() const;  ///< size of the archive
  /// Frames that the journal does not list; found by scanning, their xxh3 is 0 (unknown).
  int recovered_frames() const;
  /// Records of the journal that were torn, rotten, or at odds with the archive.
  int damaged_records() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace raystage
