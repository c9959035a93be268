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

#include "base/contained_path.h"
#include "base/time.h"
#include "schemas/pixel_encoding.h"
#include "store/frame_buffers.h"
#include "store/jpegxl/deep_picture.h"
#include "store/remote_frames.h"
#include "store/rotten_frame.h"
#include "store/unpacked_frames.h"

namespace raystage::store {

/// State of one frame of a camera. The numbers are stored on disk: only append new ones.
enum class FrameStatus : std::uint8_t {
  kStored = 0,
  kDroppedBySource = 1,      ///< the camera or its driver skipped it (a gap in its counter)
  kDroppedRamFull = 2,       ///< arrived, but the memory for frames was full
  kDroppedEncoder = 3,       ///< arrived, could not be encoded
  kTorn = 4,                 ///< arrived incomplete
  kStartUp = 5,              ///< lost while the camera started
  kDroppedDiskFull = 6,      ///< arrived, could not be written
  kDroppedLate = 7,          ///< arrived after a later frame
  kUnreadable = 8,           ///< arrived, but is no JPEG or one of another size
  kDroppedMemoryCeiling = 9  ///< arrived, but the process could have no more memory
};
inline constexpr std::size_t kFrameStatusCount = 10;
const char* name_of(FrameStatus status);

/// Marks a time that was not recorded.
inline constexpr Nanoseconds kUnknownTime = std::numeric_limits<Nanoseconds>::min();

/// Arrival time and source counter of a frame, in addition to its time stamp.
struct FrameOrigin {
  Nanoseconds arrival_ns = kUnknownTime;  ///< at the host, since the take's epoch
  std::uint64_t sequence = 0;  ///< the source's own frame counter, or the count of arrivals
};

/// One record of the journal (48 bytes on disk, layout in docs/formats/journal.md).
struct FrameRecord {
  Nanoseconds time_ns = 0;   ///< since the take's epoch
  std::uint64_t offset = 0;  ///< of the frame's bytes in the archive; 0 when not stored
  std::uint32_t size = 0;    ///< as stored, bytes; 0 when not stored
  FrameStatus status = FrameStatus::kStored;
  std::uint64_t xxh3 = 0;                 ///< XXH3-64 of the stored bytes; 0 when not stored
  Nanoseconds arrival_ns = kUnknownTime;  ///< see FrameOrigin; journals of version 1 have none
  std::uint64_t sequence = 0;             ///< see FrameOrigin; 0 in journals of version 1
  /// The frame's record was lost and made anew: `xxh3` is that of the bytes found in the archive,
  /// and nothing shows whether these are the recorded ones.
  bool is_unverified = false;
  bool operator==(const FrameRecord&) const = default;
};

/// The form of the frames of an archive (Matroska's CodecID).
enum class FrameCodec : std::uint8_t {
  kJpeg,     ///< every frame is a JPEG
  kPacked,   ///< packed frames (store/jpegxl/packed_frame.h), and JPEGs that could not be packed
  kPicture,  ///< JPEG XL pictures of more than 8 bits (schemas::PixelEncoding)
  kHevc,     ///< temporal frames (store/temporal/temporal_frame.h), HEVC
  kAv1,      ///< temporal frames, AV1
  kHevcCameras,  ///< temporal frames that refer to those of other cameras, HEVC
  kAv1Cameras    ///< likewise, AV1
};
/// Returns whether frames are lossy and refer to each other.
bool is_temporal(FrameCodec codec);
/// Returns whether frames refer to those of other cameras, so that they are read with their take.
bool refers_to_cameras(FrameCodec codec);
enum class VideoCodec : std::uint8_t;  // store/temporal/temporal_frame.h
/// Returns the codec of temporal frames.
VideoCodec video_codec_of(FrameCodec codec);

/// Most frames of one append(): the frames are written before their records, so that a crash leaves
/// at most so many whole frames at the end without a record.
inline constexpr int kMaxBatchFrames = 16;

/// One frame to append, or the record that it is missing.
struct NewFrame {
  Nanoseconds time_ns = 0;          ///< since the take's epoch
  std::span<const std::byte> jpeg;  ///< of a frame to store, in the archive's form
  FrameStatus status = FrameStatus::kStored;
  FrameOrigin origin;
  bool is_unverified = false;  ///< see FrameRecord
};

/// Writes one camera's Matroska archive and its journal: 1 ns time scale, one cluster per frame.
/// Each frame is complete on disk (in the page cache) when append returns. close() fills in cues,
/// duration and sizes; the file is readable without them.
class ArchiveWriter {
 public:
  struct Description {
    std::string camera_id;
    int width = 0, height = 0;  ///< pixels
    Nanoseconds epoch_utc = 0;  ///< of time 0, since 1970 (Matroska's DateUTC)
    FrameCodec codec = FrameCodec::kJpeg;
  };
  /// Creates both files. Throws Error (failed) when they exist already or cannot be created.
  ArchiveWriter(const std::filesystem::path& archive, const std::filesystem::path& journal,
                const Description& description);
  ~ArchiveWriter();  ///< closes and ignores errors; call close() to receive them
  ArchiveWriter(ArchiveWriter&&) noexcept;
  ArchiveWriter& operator=(ArchiveWriter&&) noexcept;

  /// Opens the archive and journal of an earlier recording, closed or not, to append to them.
  /// Truncates a torn end, adds frames that the journal lacks to it, and upgrades a journal of
  /// version 1 to version 2. A crash at any moment leaves files that can be read and resumed. Reads
  /// only the frames at the end and those that the journal lacks. Throws Error (bad input) if the
  /// archive is missing, has another camera, image size or epoch than `description`, or has a
  /// damaged header (`raystage repair`), or is_temporal(). Throws Error (failed) if it is open for
  /// writing elsewhere, or the disk fails.
  static ArchiveWriter resume(const std::filesystem::path& archive,
                              const std::filesystem::path& journal, const Description& description);

  /// Appends a JPEG. Times must increase from stored frame to stored frame and must not fall below
  /// that of a missing one; the range is 0 to 104 days. Throws Error (bad input) for a wrong time
  /// or an empty frame, and Error (failed) if the disk fails; the files then end with the last
  /// complete frame.
  void append(std::span<const std::byte> jpeg, Nanoseconds time, FrameOrigin origin = {});
  /// Records a missing frame (`status` other than kStored). Its time must not be less than that of
  /// the previous record, stored or missing. For a late frame pass last_time() and its own
  /// `origin`.
  void append_missing(FrameStatus status, Nanoseconds time, FrameOrigin origin = {});
  /// Appends the record of another archive again, at its own time; `jpeg`: its frame if it is
  /// stored. Throws as the functions above do.
  void append_again(const FrameRecord& record, std::span<const std::byte> jpeg);
  /// Appends up to kMaxBatchFrames frames by the same rules, all or none, with one write to each
  /// file. Throws as the functions above do.
  void append(std::span<const NewFrame> frames);
  /// Returns the time of the last record, stored or missing; -1 before the first.
  Nanoseconds last_time() const;
  /// Writes every frame whose append returned before the call to the disk, and waits for it: these
  /// frames survive a power loss. Drops them from the kernel's cache, as recording does not read
  /// them again. May run concurrently with append(), but not with close(). Throws Error (failed) if
  /// the disk fails.
  void flush();
  /// Completes and closes both files. Does not wait for the disk; TakeWriter::commit does, once for
  /// all archives. Throws Error (failed) if the disk fails; the frames stay readable.
  void close();

 private:
  struct Files;
  explicit ArchiveWriter(std::unique_ptr<Files> files);
  Files& open_files() const;
  std::unique_ptr<Files> files_;
};

class ArchiveReader;
class FramesByHash;

/// The archives of a take, for those whose frames refer to other cameras.
class TakeArchives {
 public:
  virtual ~TakeArchives() = default;
  virtual int camera_count() const = 0;
  /// Throws Error (bad input) if the archive cannot be read.
  virtual const ArchiveReader& archive(int camera) const = 0;
  /// Finds frames anywhere in these archives.
  virtual const FramesByHash& frames_by_hash() const = 0;
};

/// Reads one camera's archive. The journal is the index; where it is missing, torn or incomplete,
/// the Matroska file is scanned instead. A file truncated at any byte gives every complete frame.
/// Const members are thread-safe. Frames are copied from the file, which another process may
/// truncate meanwhile. Packed frames are unpacked: all members that return a frame return its JPEG,
/// except stored() and picture(). Of temporal frames that is a JPEG of the decoded picture
/// (store/temporal/planes.h); one whose group is damaged before it counts as rotten.
class ArchiveReader {
 public:
  /// Opens an archive and its journal. `buffers`: hold the bytes of frames, shared with other
  /// readers; null: the reader has its own. `unpacked`: holds unpacked frames, likewise. Throws
  /// Error (bad input) if it is not a Matroska file, has another time scale, or the journal has a
  /// future version or belongs to another archive.
  ArchiveReader(const ContainedPath& archive, const ContainedPath& journal,
                std::shared_ptr<FrameBuffers> buffers = nullptr,
                std::shared_ptr<UnpackedFrames> unpacked = nullptr);
  ArchiveReader(const std::filesystem::path& archive, const std::filesystem::path& journal);
  /// Represents the archive of a camera on another host. `records`: in order. `remote` supplies the
  /// bytes of frames; if it is null, `records` must be empty. `unpacked`: decodes pictures, as
  /// above.
  ArchiveReader(const ArchiveWriter::Description& description, std::vector<FrameRecord> records,
                std::shared_ptr<const RemoteFrames> remote,
                std::shared_ptr<UnpackedFrames> unpacked = nullptr);
  ~ArchiveReader();
  ArchiveReader(ArchiveReader&&) noexcept;
  ArchiveReader& operator=(ArchiveReader&&) noexcept;

  /// Returns every record, stored or missing. Times do not decrease; a missing frame may have the
  /// time of its neighbour.
  std::span<const FrameRecord> records() const;
  /// Returns the stored frames by strictly increasing time. "Frame i" always is an index into
  /// these.
  std::span<const FrameRecord> frames() const;
  /// Returns the index of the frame nearest to `time` (the earlier of two equally near), or nullopt
  /// without frames.
  std::optional<int> nearest_frame(Nanoseconds time) const;

  /// Returns the JPEG bytes of frame i, from the file or another host. For a picture of more than 8
  /// bits that is a new JPEG of its sRGB codes, clipped at white: only to look at. Throws
  /// RottenFrame if the bytes
  /// are not the recorded ones, which is checked once per frame, or if a packed frame or a picture
  /// cannot be decoded. Throws Error (bad input) if the disk cannot read them or the file was
  /// truncated, and Error (failed) if libjxl cannot be run.
  FrameBytes jpeg(int frame) const;
  /// Returns the bytes as jpeg() does, or nullopt where jpeg() would throw RottenFrame.
  std::optional<FrameBytes> intact_jpeg(int frame) const;
  /// Returns the bytes of frame i as they are stored: the JPEG, packed frame or picture; the JPEG
  /// of a packed frame on another host. Throws as jpeg().
  FrameBytes stored(int frame) const;
  /// Returns the bytes as stored() does, or nullopt where stored() would throw RottenFrame.
  std::optional<FrameBytes> intact_stored(int frame) const;
  /// Returns frame i of an archive of pictures (FrameCodec::kPicture), all of whose samples are
  /// finite. Decodes anew with each call. Throws as jpeg().
  DeepPicture picture(int frame) const;
  /// Returns the meaning of the samples of picture(); nullopt: frames are JPEG or it is not known.
  const std::optional<schemas::PixelEncoding>& pixel_encoding() const;
  /// Sets the take of which this is the archive of a camera, for refers_to_cameras(). It must
  /// outlive the reader.
  void set_take(const TakeArchives& take, int camera);
  /// Sets what take.json states of the samples.
  void set_pixel_encoding(const schemas::PixelEncoding& encoding);
  /// Returns whether jpeg() would throw RottenFrame; reads the frame only if that is not known yet.
  /// Does not unpack: that a packed frame cannot be unpacked is known after jpeg() has tried.
  bool is_rotten(int frame) const;
  /// Returns the structure of frame i. Throws as jpeg() and parse_jpeg_layout(); `name`: for
  /// errors.
  JpegLayout layout(int frame, std::string_view name) const;
  /// Returns the bytes as jpeg() does, but only those needed to decode the `wanted` MCUs (empty:
  /// all) are guaranteed to be valid. `layout`: of the frame.
  FrameBytes jpeg_part(int frame, const JpegLayout& layout, const McuMask& wanted) const;
  /// Returns whether the frames are on another host.
  bool is_remote() const;
  /// Adds `by` to the times of all records, for an archive with another epoch than its take.
  void shift_times(Nanoseconds by);
  /// Hints to the kernel to read frame i from the disk in the background.
  void read_ahead(int frame) const;
  /// Reads frame i and returns whether its stored bytes have the journal's XXH3; false if the
  /// journal has none. Throws Error as jpeg() does.
  bool verify_frame(int frame) const;
  /// Returns the XXH3-64 of the JPEG of frame i, which packing does not change, without unpacking:
  /// for fingerprints. 0: unknown. Throws Error as jpeg() does.
  std::uint64_t jpeg_xxh3(int frame) const;
  /// Returns the XXH3-64 of the JPEG from which frame i was made: of a frame that is encoded as
  /// video, that of its source; otherwise as jpeg_xxh3(). Throws Error as jpeg() does.
  std::uint64_t recorded_xxh3(int frame) const;
  /// Returns whether frame i is stored packed. Throws Error as jpeg() does.
  bool is_packed(int frame) const;

  const ArchiveWriter::Description& description() const;
  bool was_closed() const;      ///< false: the recording ended in a crash or still runs
  std::uint64_t bytes() const;  ///< size of the archive
  /// Returns the count of frames that only scanning found, not the journal; their xxh3 is 0
  /// (unknown).
  int recovered_frames() const;
  /// Returns the count of journal records that are torn, corrupt, or contradict the archive.
  int damaged_records() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace raystage::store
