// SPDX-License-Identifier: Apache-2.0
#include "store/matroska.h"

#include <xxhash.h>

#include <algorithm>
#include <cassert>
#include <compare>
#include <cstring>
#include <limits>

#include "base/cancellation.h"
#include "base/error.h"
#include "store/ebml.h"
#include "store/temporal/temporal_frame.h"

// Element identifiers: RFC 9559 (Matroska), section 5.
namespace raystage::store::matroska {
namespace {

using ebml::Element;
using Bytes = std::span<const std::byte>;

constexpr std::uint32_t kEbml = 0x1A45DFA3, kEbmlVersion = 0x4286, kEbmlReadVersion = 0x42F7,
                        kEbmlMaxIdLength = 0x42F2, kEbmlMaxSizeLength = 0x42F3, kDocType = 0x4282,
                        kDocTypeVersion = 0x4287, kDocTypeReadVersion = 0x4285;
constexpr std::uint32_t kSegment = 0x18538067, kSeekHead = 0x114D9B74, kSeek = 0x4DBB,
                        kSeekId = 0x53AB, kSeekPosition = 0x53AC;
constexpr std::uint32_t kInfo = 0x1549A966, kTimestampScale = 0x2AD7B1, kDuration = 0x4489,
                        kDateUtc = 0x4461, kMuxingApp = 0x4D80, kWritingApp = 0x5741;
constexpr std::uint32_t kTracks = 0x1654AE6B, kTrackEntry = 0xAE, kTrackNumber = 0xD7,
                        kTrackUid = 0x73C5, kTrackType = 0x83, kFlagLacing = 0x9C,
                        kDefaultDuration = 0x23E383, kTrackName = 0x536E, kLanguage = 0x22B59C,
                        kCodecId = 0x86, kVideo = 0xE0, kPixelWidth = 0xB0, kPixelHeight = 0xBA,
                        kFlagInterlaced = 0x9A;
constexpr std::uint32_t kCluster = 0x1F43B675, kTimestamp = 0xE7, kSimpleBlock = 0xA3;
constexpr std::uint32_t kCues = 0x1C53BB6B, kCuePoint = 0xBB, kCueTime = 0xB3,
                        kCueTrackPositions = 0xB7, kCueTrack = 0xF7, kCueClusterPosition = 0xF1;

constexpr std::uint32_t kVoid = 0xEC, kCrc32 = 0xBF, kTags = 0x1254C367, kChapters = 0x1043A770,
                        kAttachments = 0x1941A469;

// Elements that may be between clusters. Anything else counts as damage: the size of an element
// with a damaged identifier may not lead to the next one.
constexpr std::array kSkipped{kVoid, kCrc32,    kSeekHead, kInfo,       kTracks,
                              kCues, kChapters, kTags,     kAttachments};

constexpr std::array kClusterIdBytes{std::byte{0x1F}, std::byte{0x43}, std::byte{0xB6},
                                     std::byte{0x75}};
constexpr std::array kEbmlIdBytes{std::byte{0x1A}, std::byte{0x45}, std::byte{0xDF},
                                  std::byte{0xA3}};

/// Of the track. Matroska has no identifier for JPEG XL; FFmpeg 5 has none either.
struct CodecName {
  FrameCodec codec;
  std::string_view name;
};
constexpr std::array kCodecs{
    CodecName{FrameCodec::kJpeg, "V_MJPEG"}, CodecName{FrameCodec::kPacked, "V_JPEGXL"},
    CodecName{FrameCodec::kPicture, "V_JPEGXL/PICTURE"},
    CodecName{FrameCodec::kHevc, "V_MPEGH/ISO/HEVC"}, CodecName{FrameCodec::kAv1, "V_AV1"},
    // Names of our own: players would show frames without those that they refer to.
    CodecName{FrameCodec::kHevcCameras, "V_MPEGH/ISO/HEVC/CAMERAS"},
    CodecName{FrameCodec::kAv1Cameras, "V_AV1/CAMERAS"}};

std::string_view name_of(FrameCodec codec) {
  return std::ranges::find(kCodecs, codec, &CodecName::codec)->name;
}

FrameCodec codec_named(std::string_view name) {
  const auto* const found = std::ranges::find(kCodecs, name, &CodecName::name);
  return found == kCodecs.end() ? FrameCodec::kJpeg : found->codec;
}

// 2001-01-01T00:00:00Z, the epoch of Matroska dates, in nanoseconds since 1970.
constexpr Nanoseconds kMatroskaEpoch = 978'307'200 * kNanosecondsPerSecond;
constexpr std::size_t kBlockHeaderBytes = 4;  // track, two bytes of relative time, flags

int pixels(Bytes file, const Element& element) {
  const auto value = ebml::read_uint(file, element).value_or(0);
  return value <= std::numeric_limits<int>::max() ? static_cast<int>(value) : 0;
}

void read_track(Bytes file, const Element& track, ArchiveWriter::Description& description) {
  ebml::for_each_child(file, track, [&](const Element& child) {
    if (child.id == kTrackName) description.camera_id = ebml::read_string(file, child);
    if (child.id == kCodecId) description.codec = codec_named(ebml::read_string(file, child));
    if (child.id != kVideo) return;
    ebml::for_each_child(file, child, [&](const Element& leaf) {
      if (leaf.id == kPixelWidth) description.width = pixels(file, leaf);
      if (leaf.id == kPixelHeight) description.height = pixels(file, leaf);
    });
  });
}

void read_tracks(Bytes file, const Element& tracks, ArchiveWriter::Description& description) {
  const Bytes inside = file.first(tracks.end());
  if (const auto entry = ebml::read_whole_element(inside, tracks.data_offset);
      entry && entry->id == kTrackEntry) {
    read_track(file, *entry, description);
  }
}

void read_info(Bytes file, const Element& info, std::string_view name,
               ArchiveWriter::Description& description) {
  std::uint64_t scale = 1'000'000;  // Matroska's default
  ebml::for_each_child(file, info, [&](const Element& child) {
    if (child.id == kTimestampScale) scale = ebml::read_uint(file, child).value_or(0);
    if (child.id != kDateUtc) return;
    const auto date = ebml::read_int(file, child).value_or(0);
    if (date <= std::numeric_limits<Nanoseconds>::max() - kMatroskaEpoch) {
      description.epoch_utc = date + kMatroskaEpoch;
    }
  });
  if (scale != 1) {
    throw Error::bad_input(
        "the Matroska time scale is " + std::to_string(scale) +
            " ns instead of the 1 ns of an archive",
        std::string(name) + " @" + std::to_string(info.offset),
        "Use an archive written by Raystage; convert other movies with `raystage import`");
  }
}

// Returns the cluster at `offset` if it is whole and has one unlaced frame, as our writer makes it.
std::optional<FoundFrame> read_cluster(Bytes file, std::size_t offset, std::size_t& end) {
  const auto cluster = ebml::read_whole_element(file, offset);
  if (!cluster || cluster->id != kCluster) return std::nullopt;
  const Bytes inside = file.first(cluster->end());
  const auto timestamp = ebml::read_whole_element(inside, cluster->data_offset);
  if (!timestamp || timestamp->id != kTimestamp) return std::nullopt;
  const auto time = ebml::read_uint(file, *timestamp);
  const auto block = ebml::read_whole_element(inside, timestamp->end());
  if (!time || *time > static_cast<std::uint64_t>(kMaxTime) || !block ||
      block->id != kSimpleBlock || block->end() != cluster->end() ||
      block->size <= kBlockHeaderBytes ||
      block->size - kBlockHeaderBytes > std::numeric_limits<std::uint32_t>::max()) {
    return std::nullopt;
  }
  end = cluster->end();
  return FoundFrame{static_cast<Nanoseconds>(*time), block->data_offset + kBlockHeaderBytes,
                    static_cast<std::size_t>(block->size) - kBlockHeaderBytes};
}

}  // namespace

Header make_header(const ArchiveWriter::Description& description, HeaderForm form) {
  ebml::Writer head;
  head.put_uint(kEbmlVersion, 1);
  head.put_uint(kEbmlReadVersion, 1);
  head.put_uint(kEbmlMaxIdLength, 4);
  head.put_uint(kEbmlMaxSizeLength, 8);
  head.put_string(kDocType, "matroska");
  head.put_uint(kDocTypeVersion, 4);
  head.put_uint(kDocTypeReadVersion, 2);

  ebml::Writer info;
  info.put_uint(kTimestampScale, 1);
  info.put_int(kDateUtc, description.epoch_utc - kMatroskaEpoch);
  info.put_string(kMuxingApp, "raystage");
  info.put_string(kWritingApp, "raystage");
  const std::size_t duration_in_info = info.size();
  info.put_void(kDurationBytes);

  ebml::Writer video;
  video.put_uint(kFlagInterlaced, 2);  // progressive
  video.put_uint(kPixelWidth, static_cast<std::uint64_t>(description.width));
  video.put_uint(kPixelHeight, static_cast<std::uint64_t>(description.height));
  ebml::Writer track;
  track.put_uint(kTrackNumber, 1);
  // Not 0, and constant per camera: archives are reproducible.
  track.put_uint(kTrackUid,
                 XXH3_64bits(description.camera_id.data(), description.camera_id.size()) | 1);
  track.put_uint(kTrackType, 1);  // video
  track.put_uint(kFlagLacing, 0);
  track.put_string(kLanguage, "und");
  track.put_string(kTrackName, description.camera_id);
  track.put_string(kCodecId, std::string(name_of(description.codec)));
  const std::size_t rate_in_track = track.size();
  if (form == HeaderForm::kWithRate) track.put_void(kRateBytes);
  track.put_master(kVideo, video);
  ebml::Writer tracks;
  tracks.put_master(kTrackEntry, track);

  Header header;
  header.codec = description.codec;
  ebml::Writer file;
  file.put_master(kEbml, head);
  file.put_id(kSegment);
  header.segment_size_offset = file.size();
  file.put_size(ebml::kUnknownSize);
  header.segment_data_offset = file.size();
  header.seek_head_offset = file.size();
  file.put_void(kSeekHeadBytes);
  header.info_offset = file.size();
  file.put_id(kInfo);
  file.put_size(info.size());
  header.duration_offset = file.size() + duration_in_info;
  file.put_raw(info.bytes());
  header.tracks_offset = file.size();
  file.put_master(kTracks, tracks);
  // The track's content is the last of the header.
  if (form == HeaderForm::kWithRate) {
    header.rate_offset = file.size() - track.size() + rate_in_track;
  }
  header.bytes.assign(file.bytes().begin(), file.bytes().end());
  return header;
}

namespace {

/// Returns the number of bytes, of those that close() does not fill in, that differ.
std::size_t differing_bytes(Bytes file, const Header& header) {
  const std::size_t size = std::min(file.size(), header.bytes.size());
  std::size_t differing = 0;
  const auto filled_in = [&](std::size_t at) {
    const auto within = [at](std::size_t offset, std::size_t count) {
      return at >= offset && at < offset + count;
    };
    return within(header.segment_size_offset, ebml::kSizeBytes) ||
           within(header.seek_head_offset, kSeekHeadBytes) ||
           within(header.duration_offset, kDurationBytes) ||
           (header.rate_offset > 0 && within(header.rate_offset, kRateBytes));
  };
  for (std::size_t i = 0; i < size; ++i) {
    if (file[i] != header.bytes[i] && !filled_in(i)) ++differing;
  }
  return differing;
}

}  // namespace

bool begins_with(Bytes file, const Header& header) { return differing_bytes(file, header) == 0; }

Header header_of_file(Bytes file, const ArchiveWriter::Description& description,
                      std::optional<std::size_t> first_cluster) {
  // Of a header that is not intact, its length says more than its bytes: a frame follows it.
  struct Distance {
    bool is_damaged, is_not_before_a_frame;
    std::size_t bytes;
    auto operator<=>(const Distance&) const = default;
  };
  const auto distance_to = [&](const Header& header) {
    const std::size_t bytes = differing_bytes(file, header);
    const std::size_t end = header.bytes.size();
    const bool is_before_a_frame = first_cluster == end || parse_cluster(file, end).has_value();
    return Distance{bytes > 0, !is_before_a_frame, bytes};
  };
  Header nearest = make_header(description, HeaderForm::kWithRate);
  Distance least = distance_to(nearest);
  const auto consider = [&](const ArchiveWriter::Description& candidate, HeaderForm form) {
    Header header = make_header(candidate, form);
    const Distance distance = distance_to(header);
    if (distance < least) {
      nearest = std::move(header);
      least = distance;
    }
  };
  consider(description, HeaderForm::kWithoutRate);
  for (const CodecName& codec : kCodecs) {
    ArchiveWriter::Description other = description;
    other.codec = codec.codec;
    consider(other, HeaderForm::kWithRate);
    consider(other, HeaderForm::kWithoutRate);
  }
  return nearest;
}

std::array<std::byte, kClusterHeaderBytes> make_cluster_header(Nanoseconds time, std::size_t size,
                                                               bool is_key) {
  ebml::Writer writer;
  constexpr std::size_t kClusterOwnHeader = 4 + ebml::kSizeBytes;
  writer.put_id(kCluster);
  writer.put_size(kClusterHeaderBytes - kClusterOwnHeader + size);
  writer.put_uint(kTimestamp, static_cast<std::uint64_t>(time));
  writer.put_id(kSimpleBlock);
  writer.put_size(kBlockHeaderBytes + size);
  writer.put_big_endian(0x81, 1);               // track 1
  writer.put_big_endian(0, 2);                  // time relative to the cluster
  writer.put_big_endian(is_key ? 0x80 : 0, 1);  // no lacing
  assert(writer.size() == kClusterHeaderBytes);
  std::array<std::byte, kClusterHeaderBytes> bytes{};
  std::ranges::copy(writer.bytes(), bytes.begin());
  return bytes;
}

std::vector<std::byte> make_cues(std::span<const CuePoint> points, const Header& header) {
  ebml::Writer all;
  for (const CuePoint& point : points) {
    ebml::Writer position, cue;
    position.put_uint(kCueTrack, 1);
    position.put_uint(kCueClusterPosition, point.cluster_offset - header.segment_data_offset);
    cue.put_uint(kCueTime, static_cast<std::uint64_t>(point.time));
    cue.put_master(kCueTrackPositions, position);
    all.put_master(kCuePoint, cue);
  }
  ebml::Writer cues;
  cues.put_master(kCues, all);
  return {cues.bytes().begin(), cues.bytes().end()};
}

std::vector<std::byte> make_seek_head(const Header& header, std::uint64_t cues_offset) {
  ebml::Writer seeks;
  const auto add = [&](std::uint32_t id, std::uint64_t offset) {
    ebml::Writer seek;
    seek.put_id(kSeekId);
    seek.put_big_endian(0x84, 1);  // four bytes follow
    seek.put_big_endian(id, 4);
    seek.put_uint(kSeekPosition, offset - header.segment_data_offset);
    seeks.put_master(kSeek, seek);
  };
  add(kInfo, header.info_offset);
  add(kTracks, header.tracks_offset);
  add(kCues, cues_offset);
  ebml::Writer writer;
  writer.put_master(kSeekHead, seeks);
  writer.put_void(kSeekHeadBytes - writer.size());
  assert(writer.size() == kSeekHeadBytes);
  return {writer.bytes().begin(), writer.bytes().end()};
}

std::vector<std::byte> make_duration(Nanoseconds duration) {
  ebml::Writer writer;
  writer.put_float(kDuration, static_cast<double>(duration));
  assert(writer.size() == kDurationBytes);
  return {writer.bytes().begin(), writer.bytes().end()};
}

std::vector<std::byte> make_segment_size(std::uint64_t size) {
  ebml::Writer writer;
  writer.put_size(size);
  return {writer.bytes().begin(), writer.bytes().end()};
}

std::optional<Nanoseconds> regular_interval(std::span<const CuePoint> points) {
  if (points.size() < 2) return std::nullopt;
  std::vector<Nanoseconds> intervals;
  for (std::size_t i = 1; i < points.size(); ++i) {
    intervals.push_back(points[i].time - points[i - 1].time);
  }
  const auto middle = intervals.begin() + static_cast<std::ptrdiff_t>(intervals.size() / 2);
  std::nth_element(intervals.begin(), middle, intervals.end());
  const Nanoseconds median = *middle;
  const auto regular = std::ranges::count_if(intervals, [median](Nanoseconds interval) {
    return std::abs(interval - median) <= median / 10;
  });
  if (median <= 0 || 2 * static_cast<std::size_t>(regular) <= intervals.size()) return std::nullopt;
  return median;
}

Trailer make_trailer(std::span<const CuePoint> points, const Header& header, std::uint64_t end) {
  Trailer closing;
  if (!points.empty()) {
    closing.cues = make_cues(points, header);
    const Nanoseconds last = points.back().time;
    const Nanoseconds interval = points.size() > 1 ? last - points[points.size() - 2].time : 1;
    closing.duration = make_duration(last + interval);
    closing.seek_head = make_seek_head(header, end);
    const auto regular = regular_interval(points);
    if (header.rate_offset > 0 && regular) {
      ebml::Writer rate;
      rate.put_uint(kDefaultDuration, static_cast<std::uint64_t>(*regular));
      assert(rate.size() == kRateBytes);
      closing.rate.assign(rate.bytes().begin(), rate.bytes().end());
    }
  }
  closing.segment_size = make_segment_size(end + closing.cues.size() - header.segment_data_offset);
  return closing;
}

Preamble read_preamble(Bytes file, std::string_view name) {
  const std::size_t magic = std::min(file.size(), kEbmlIdBytes.size());
  if (!std::ranges::equal(file.first(magic), Bytes(kEbmlIdBytes).first(magic))) {
    throw Error::bad_input("the file is not a Matroska file", std::string(name) + " @0",
                           "Run `raystage repair` on the take, or restore the archive from a copy");
  }
  Preamble preamble;
  preamble.is_cut = true;  // a recorder writes the whole header before it lists a frame
  const auto head = ebml::read_whole_element(file, 0);
  if (!head) return preamble;
  const auto segment = ebml::read_element(file, head->end());
  if (!segment) return preamble;
  if (segment->id != kSegment) {
    throw Error::bad_input("the Matroska file has no Segment",
                           std::string(name) + " @" + std::to_string(head->end()),
                           "Run `raystage repair` on the take, or restore the archive from a copy");
  }
  const bool has_size = !segment->unknown_size;
  preamble.closed = has_size && segment->size <= file.size() - segment->data_offset;
  preamble.is_cut = has_size && !preamble.closed;
  auto element = ebml::read_element(file, segment->data_offset);
  while (element) {
    if (element->id == kCluster || element->id == kCues) {
      preamble.first_cluster = element->offset;
      break;
    }
    if (!ebml::read_whole_element(file, element->offset)) break;
    if (element->id == kInfo) read_info(file, *element, name, preamble.description);
    if (element->id == kTracks) {
      read_tracks(file, *element, preamble.description);
      // Even if what follows is damaged: our clusters begin here.
      preamble.first_cluster = element->end();
      break;
    }
    element = ebml::read_element(file, element->end());
  }
  return preamble;
}

std::optional<FoundFrame> parse_cluster(Bytes file, std::size_t offset) {
  std::size_t end = 0;
  const auto frame = read_cluster(file, offset, end);
  if (!frame) return std::nullopt;
  const bool is_key = is_key_frame(file.subspan(frame->offset, frame->size));
  if (!std::ranges::equal(make_cluster_header(frame->time, frame->size, is_key),
                          file.subspan(offset, frame->offset - offset))) {
    return std::nullopt;
  }
  return frame;
}

std::vector<FoundFrame> find_clusters(Bytes file, std::size_t begin) {
  std::vector<FoundFrame> frames;
  constexpr std::size_t kAtOnce = 16 << 20;  // bytes between two checks for a stop
  while (begin < file.size()) {
    throw_if_cancelled();
    const std::size_t part = std::min(kAtOnce, file.size() - begin);
    const void* next =
        std::memchr(file.data() + begin, std::to_integer<int>(kClusterIdBytes[0]), part);
    if (next == nullptr) {
      begin += part;
      continue;
    }
    begin = static_cast<std::size_t>(static_cast<const std::byte*>(next) - file.data());
    if (const auto frame = parse_cluster(file, begin)) frames.push_back(*frame);
    ++begin;
  }
  return frames;
}

std::vector<FoundFrame> scan_clusters(Bytes file, std::size_t begin, std::size_t end) {
  end = std::min(end, file.size());
  std::vector<FoundFrame> frames;
  constexpr std::size_t kAtOnce = 16 << 20;  // bytes between two checks for a stop
  std::size_t looked_at = begin;
  for (std::size_t at = begin; at < end;) {
    if (at - looked_at >= kAtOnce) {
      throw_if_cancelled();
      looked_at = at;
    }
    std::size_t next = 0;
    if (const auto frame = read_cluster(file, at, next)) {
      frames.push_back(*frame);
      at = next;
    } else if (const auto element = ebml::read_whole_element(file, at);
               element && std::ranges::count(kSkipped, element->id) > 0 && element->end() <= end) {
      at = element->end();
    } else {
      // Parts overlap by an identifier less a byte.
      const Bytes rest =
          file.subspan(at + 1, std::min(end - at - 1, kAtOnce + kClusterIdBytes.size() - 1));
      const auto found =
          std::search(rest.begin(), rest.end(), kClusterIdBytes.begin(), kClusterIdBytes.end());
      const auto step = static_cast<std::size_t>(found - rest.begin());
      at += found != rest.end() || rest.size() <= kAtOnce ? 1 + step : 1 + kAtOnce;
    }
  }
  return frames;
}

}  // namespace raystage::store::matroska
