// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/time.h"
#include "store/remote_frames.h"

namespace raystage {

/// What became of one frame of a camera. The numbers are on disk: only append.
enum class FrameStatus : std::uint8_t {
  kStored = 0,
  kDroppedBySource = 1,  ///< the camera or its driver skipped it (a gap in its counter)
  kDroppedRamFull = 2,   ///< arrived, found no room
  kDroppedEncoder = 3,   ///< arrived, could not be encoded
  kTorn = 4,             ///< arrived incomplete
  kStartUp = 5,          ///< lost while the camera started
  kDroppedDiskFull = 6,  ///< arrived, could not be written
  kDroppedLate = 7,      ///< arrived after a later frame
  kUnreadable = 8        ///< arrived, but is no JPEG or one of another size
};
inline constexpr std::size_t kFrameStatusCount = 9;
const char* name_of(FrameStatus status);

/// A time that nobody took.
inline constexpr Nanoseconds kUnknownTime = std::numeric_limits<Nanoseconds>::min();

/// Where a frame came from, beside its time.
struct FrameOrigin {
  Nanoseconds arrival_ns = kUnknownTime;  ///< at the host, since the take's epoch
  std::uint64_t sequence = 0;  ///< the source's own frame counter, or the count of arrivals
};

/// One record of the journal (48 bytes on disk, layout in docs/formats/journal.md).
struct FrameRecord {
  Nanoseconds time_ns = 0;   ///< since the take's epoch
  std::uint64_t offset = 0;  ///< of the JPEG bytes in the archive; 0 when not stored
  std::uint32_t size = 0;    ///< of the JPEG, bytes; 0 when not stored
  FrameStatus status = FrameStatus::kStored;
  std::uint64_t xxh3 = 0;                 ///< XXH3-64 of the JPEG bytes; 0 when not stored
  Nanoseconds arrival_ns = kUnknownTime;  ///< see FrameOrigin; journals of version 1 have none
  std::uint64_t sequence = 0;             ///< see FrameOrigin; 0 in journals of version 1
  bool operator==(const FrameRecord&) const = default;
};

/// One frame to append, or the record that it is missing.
struct NewFrame {
  Nanoseconds time_ns = 0;          ///< since the take's epoch
  std::span<const std::byte> jpeg;  ///< of a frame to store; else not looked at
  FrameStatus status = FrameStatus::kStored;
  FrameOrigin origin;
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

  /// Opens what a recording left, closed or not, to append to it: a closed archive is opened again,
  /// what a crash left torn at the end is cut off, frames that the journal lacks are added to it,
  /// and a journal of version 1 becomes one of version 2. A crash at any moment leaves files that
  /// can be read and resumed. Reads no more of the frames than those at the end, and those that the
  /// journal lacks. Throws Error: bad input where there is no such archive or it is of another
  /// camera, image size or epoch than `description`, or its header is damaged (`raystage repair`);
  /// failed where it is open for writing elsewhere, and for the disk.
  static ArchiveWriter resume(const std::filesystem::path& archive,
                              const std::filesystem::path& journal, const Description& description);

  /// Appends a JPEG. Times must increase from stored frame to stored frame and must not fall below
  /// that of a missing one; from 0 up to 104 days. Throws Error: bad input for time or empty frame,
  /// failed for the disk; after a failure the files end with the last whole frame.
  void append(std::span<const std::byte> jpeg, Nanoseconds time, FrameOrigin origin = {});
  /// Records a frame that is not there (`status` other than kStored). Its time may be that of the
  /// record before it, stored or missing, but not less: for a frame that came late give
  /// last_time(), its origin says the rest.
  void append_missing(FrameStatus status, Nanoseconds time, FrameOrigin origin = {});
  /// Appends several by the same rules, all or none, for the price of one: in one write to each
  /// file. Throws as the others do.
  void append(std::span<const NewFrame> frames);
  /// Time of the last record, stored or missing; -1 before the first.
  Nanoseconds last_time() const;
  /// Returns when the disk has every frame whose append returned before the call: such frames
  /// survive a power loss. They leave the kernel's cache, which serves better for what is read
  /// again. May be called from another thread than the one that appends, but not
  /// beside close(). Throws Error (failed) where the disk refuses.
  void flush();
  /// Throws Error (failed) for the disk; the frames are safe and readable then all the same. Does
  /// not wait for the disk: TakeWriter::commit does, once for all.
  void close();

 private:
  struct Files;
  explicit ArchiveWriter(std::unique_ptr<Files> files);
  Files& open_files() const;
  std::unique_ptr<Files> files_;
};

/// Reads one camera's archive. The journal is the index; where it is missing, torn or behind, the
/// Matroska file is scanned instead. A file cut at any byte gives every whole frame.
/// Const members may be called from many threads at once. The archive is mapped: if someone cuts it
/// short while what jpeg() gave is looked at, touching the lost part ends the process with SIGBUS.
class ArchiveReader {
 public:
  /// Throws Error (bad input): no Matroska file, another time scale, a journal of a future version
  /// or of another archive.
  ArchiveReader(const std::filesystem::path& archive, const std::filesystem::path& journal);
  /// The archive of a camera on another host: its records, in order, and who gives the bytes of
  /// frames; null: no one does (`records` must be empty then).
  ArchiveReader(const ArchiveWriter::Description& description, std::vector<FrameRecord> records,
                std::shared_ptr<const RemoteFrames> remote);
  ~ArchiveReader();
  ArchiveReader(ArchiveReader&&) noexcept;
  ArchiveReader& operator=(ArchiveReader&&) noexcept;

  /// Every record, stored or missing. Times do not fall; a missing one may have the time of its
  /// neighbour.
  std::span<const FrameRecord> records() const;
  /// The stored ones, by strictly increasing time: "frame i" everywhere is an index into these.
  std::span<const FrameRecord> frames() const;
  /// Index of the frame whose time is nearest (the earlier at a tie), nullopt without frames.
  std::optional<int> nearest_frame(Nanoseconds time) const;

  /// The JPEG bytes of frame i, mapped from the file and brought into memory, valid as long as the
  /// reader; or fetched from another host. What they are is not checked; see verify_frame. Throws
  /// Error (bad input) where the disk cannot read them or the file was cut.
  FrameBytes jpeg(int frame) const;
  /// Returns the structure of frame i. Throws as jpeg() and parse_jpeg_layout(); `name` stands in
  /// errors.
  JpegLayout layout(int frame, std::string_view name) const;
  /// As jpeg(), but only what decoding the `wanted` MCUs reads is sure to be there (empty: all).
  /// `layout`: of the frame.
  FrameBytes jpeg_part(int frame, const JpegLayout& layout, const McuMask& wanted) const;
  /// Whether the frames are on another host.
  bool is_remote() const;
  /// Adds `by` to the times of all records: the archive counts from another epoch than its take.
  void move_times(Nanoseconds by);
  /// Asks for frame i to be read from the disk while the caller goes on. A hint.
  void read_ahead(int frame) const;
  /// Whether the bytes of frame i still have the journal's XXH3; false where it holds none. Throws
  /// as jpeg() does.
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
