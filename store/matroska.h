// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "store/archive.h"

namespace raystage::store::matroska {

/// Bytes from the start of a cluster to its JPEG, in the layout of our writer.
inline constexpr std::size_t kClusterHeaderBytes = 35;
/// The largest time. FFmpeg converts times to double and rounds larger ones.
inline constexpr Nanoseconds kMaxTime = kMaxArchiveTime;

/// The first bytes of Cues.
inline constexpr std::array kCuesIdBytes{std::byte{0x1C}, std::byte{0x53}, std::byte{0xBB},
                                         std::byte{0x6B}};

/// Layout of the header. Archives written before version 0.2 have no space for the frame rate.
enum class HeaderForm { kWithoutRate, kWithRate };

/// The header of a file, and the offsets of the parts that close() fills in.
struct Header {
  std::vector<std::byte> bytes;
  std::size_t segment_size_offset = 0;  ///< the eight-byte size field
  std::size_t segment_data_offset = 0;  ///< origin of positions in SeekHead and Cues
  std::size_t seek_head_offset = 0;     ///< a Void of kSeekHeadBytes until closed
  std::size_t duration_offset = 0;      ///< a Void of kDurationBytes until closed
  std::size_t info_offset = 0, tracks_offset = 0;
  std::size_t rate_offset = 0;  ///< a Void of kRateBytes until closed; 0: kWithoutRate
  FrameCodec codec = FrameCodec::kJpeg;
};
inline constexpr std::size_t kSeekHeadBytes = 128;
inline constexpr std::size_t kDurationBytes = 11;
inline constexpr std::size_t kRateBytes = 12;

/// Returns the EBML header, a Segment of unknown size, space for the SeekHead, Info and Tracks.
Header make_header(const ArchiveWriter::Description& description,
                   HeaderForm form = HeaderForm::kWithRate);

/// Returns the header that a file of this description has: of the form and codec from which the
/// file, which may be damaged or truncated, differs least. Documents do not state the codec.
/// `first_cluster`: where the first frame begins, if something else states it: the header's length.
Header header_of_file(std::span<const std::byte> file,
                      const ArchiveWriter::Description& description,
                      std::optional<std::size_t> first_cluster = {});

/// Returns whether a file begins with this header, apart from the parts that close() fills in. A
/// file truncated within its header may.
bool begins_with(std::span<const std::byte> file, const Header& header);

/// Returns the bytes before a frame of `size` bytes: Cluster, Timestamp, SimpleBlock. `is_key`: as
/// is_key_frame() says (store/temporal/temporal_frame.h).
std::array<std::byte, kClusterHeaderBytes> make_cluster_header(Nanoseconds time, std::size_t size,
                                                               bool is_key = true);

struct CuePoint {
  Nanoseconds time = 0;
  std::uint64_t cluster_offset = 0;  ///< in the file
};
std::vector<std::byte> make_cues(std::span<const CuePoint> points, const Header& header);
/// Returns exactly kSeekHeadBytes: the SeekHead and a Void.
std::vector<std::byte> make_seek_head(const Header& header, std::uint64_t cues_offset);
/// Returns exactly kDurationBytes.
std::vector<std::byte> make_duration(Nanoseconds duration);
std::vector<std::byte> make_segment_size(std::uint64_t size);

/// Returns the interval of regular frames: the median, if most intervals are within a tenth of it.
std::optional<Nanoseconds> regular_interval(std::span<const CuePoint> points);

/// The parts that close() writes to a file whose clusters end at `end`: Cues there, the rest in the
/// header. A frame lasts until the next one; the last frame lasts as long as the one before it.
/// Without frames only the size changes, and the other parts are empty. `rate`: DefaultDuration,
/// empty if the header has no space for it or the frames are not regular.
struct Trailer {
  std::vector<std::byte> cues, duration, seek_head, segment_size, rate;
};
Trailer make_trailer(std::span<const CuePoint> points, const Header& header, std::uint64_t end);

/// The contents of the header of a file. If the file is truncated within its header, only the whole
/// elements count and first_cluster is nullopt.
struct Preamble {
  ArchiveWriter::Description description;
  std::optional<std::size_t> first_cluster;
  bool closed = false;  ///< the Segment has its size and the file is no shorter
  /// The Segment has its size, but the file is shorter; or the file ends before the Segment's size.
  bool is_cut = false;
};
/// Returns the contents of the header. Throws Error (bad input) if the bytes are not a Matroska
/// file or have another time scale.
Preamble read_preamble(std::span<const std::byte> file, std::string_view name);

/// A frame found by parsing the Matroska file.
struct FoundFrame {
  Nanoseconds time = 0;
  std::size_t offset = 0, size = 0;  ///< of the JPEG
};
/// Returns the frame of the cluster at `offset`, or nullopt if the cluster is not whole or not
/// exactly in the layout of our writer.
std::optional<FoundFrame> parse_cluster(std::span<const std::byte> file, std::size_t offset);

/// Returns the frames of all such clusters that start at or after `begin`, including overlapping
/// ones: where bytes were lost, a cluster extends into the next one.
std::vector<FoundFrame> find_clusters(std::span<const std::byte> file, std::size_t begin);

/// Returns the whole clusters that start in [begin, end). Where the structure is damaged, continues
/// at the next plausible cluster. Cost: linear in the number of bytes.
std::vector<FoundFrame> scan_clusters(std::span<const std::byte> file, std::size_t begin,
                                      std::size_t end);

}  // namespace raystage::store::matroska
