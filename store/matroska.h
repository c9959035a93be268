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

namespace raystage::matroska {

/// Bytes between the start of a cluster and the JPEG in it, as our writer lays it out.
inline constexpr std::size_t kClusterHeaderBytes = 35;
/// FFmpeg reads larger times through double and loses nanoseconds: 2^53 ns, 104 days.
inline constexpr Nanoseconds kMaxTime = Nanoseconds{1} << 53;

/// What Cues begin with.
inline constexpr std::array kCuesIdBytes{std::byte{0x1C}, std::byte{0x53}, std::byte{0xBB},
                                         std::byte{0x6B}};

/// The beginning of a file and where its parts are that close() fills in.
struct Header {
  std::vector<std::byte> bytes;
  std::size_t segment_size_offset = 0;  ///< the eight-byte size field
  std::size_t segment_data_offset = 0;  ///< what positions in SeekHead and Cues count from
  std::size_t seek_head_offset = 0;     ///< a Void of kSeekHeadBytes until closed
  std::size_t duration_offset = 0;      ///< a Void of kDurationBytes until closed
  std::size_t info_offset = 0, tracks_offset = 0;
};
inline constexpr std::size_t kSeekHeadBytes = 128;
inline constexpr std::size_t kDurationBytes = 11;

/// EBML header, Segment of unknown size, room for the SeekHead, Info, Tracks.
Header make_header(const ArchiveWriter::Description& description);

/// Whether a file begins with this header, whatever stands where close() fills in; a file cut
/// within its header may.
bool begins_with(std::span<const std::byte> file, const Header& header);

/// What stands before a JPEG of `size` bytes: Cluster, Timestamp, SimpleBlock.
std::array<std::byte, kClusterHeaderBytes> make_cluster_header(Nanoseconds time, std::size_t size);

struct CuePoint {
  Nanoseconds time = 0;
  std::uint64_t cluster_offset = 0;  ///< in the file
};
std::vector<std::byte> make_cues(std::span<const CuePoint> points, const Header& header);
/// Exactly kSeekHeadBytes: the SeekHead and a Void.
std::vector<std::byte> make_seek_head(const Header& header, std::uint64_t cues_offset);
/// Exactly kDurationBytes.
std::vector<std::byte> make_duration(Nanoseconds duration);
std::vector<std::byte> make_segment_size(std::uint64_t size);

/// What close() adds to a file whose clusters end at `end`: the Cues there, the rest in the header.
/// A frame lasts until the next, the last one as long as the one before it. Without frames only the
/// size changes, and the other parts are empty.
struct Closing {
  std::vector<std::byte> cues, duration, seek_head, segment_size;
};
Closing make_closing(std::span<const CuePoint> points, const Header& header, std::uint64_t end);

/// What the beginning of a file says. A file cut within its header gives what is whole, and no
/// first_cluster.
struct Preamble {
  ArchiveWriter::Description description;
  std::optional<std::size_t> first_cluster;
  bool closed = false;  ///< the Segment has its size and the file is no shorter
};
/// Throws Error (bad input) where the bytes are no Matroska file or one with another time scale.
Preamble read_preamble(std::span<const std::byte> file, std::string_view name);

/// A frame found in the file itself.
struct FoundFrame {
  Nanoseconds time = 0;
  std::size_t offset = 0, size = 0;  ///< of the JPEG
};
/// The cluster at `offset`, if it is whole and just as our writer makes it.
std::optional<FoundFrame> cluster_at(std::span<const std::byte> file, std::size_t offset);

/// Every such cluster that starts at or behind `begin`, also those that overlap: where bytes were
/// lost, a cluster reaches into the next one.
std::vector<FoundFrame> find_clusters(std::span<const std::byte> file, std::size_t begin);

/// Walks the clusters that start in [begin, end) and returns the whole ones. Where the structure is
/// damaged it goes on at the next cluster that makes sense; linear in the number of bytes.
std::vector<FoundFrame> scan_clusters(std::span<const std::byte> file, std::size_t begin,
                                      std::size_t end);

}  // namespace raystage::matroska
