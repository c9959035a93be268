// SPDX-License-Identifier: Apache-2.0
// Muxes frames into Matroska. Layout: EBML header, Segment of unknown size until closed, space for
// a SeekHead, Info, Tracks, Attachments, Clusters (Timestamp, SimpleBlocks), Cues. libavformat's
// own muxer has a time-stamp scale of 1 ms.
#include "exports/matroska_movie.h"

#include <fmt/format.h>
#include <xxhash.h>

#include <algorithm>
#include <array>
#include <map>
#include <optional>
#include <utility>

#include "base/atomic_file.h"
#include "base/error.h"
#include "base/posix_file.h"
#include "store/ebml.h"

namespace raystage::exports {
namespace {

namespace ebml = store::ebml;

// Element identifiers: RFC 9559, section 5.
constexpr std::uint32_t kEbml = 0x1A45DFA3, kEbmlVersion = 0x4286, kEbmlReadVersion = 0x42F7,
                        kEbmlMaxIdLength = 0x42F2, kEbmlMaxSizeLength = 0x42F3, kDocType = 0x4282,
                        kDocTypeVersion = 0x4287, kDocTypeReadVersion = 0x4285;
constexpr std::uint32_t kSegment = 0x18538067, kSeekHead = 0x114D9B74, kSeek = 0x4DBB,
                        kSeekId = 0x53AB, kSeekPosition = 0x53AC;
constexpr std::uint32_t kInfo = 0x1549A966, kTimestampScale = 0x2AD7B1, kDuration = 0x4489,
                        kDateUtc = 0x4461, kTitle = 0x7BA9, kMuxingApp = 0x4D80,
                        kWritingApp = 0x5741;
constexpr std::uint32_t kTracks = 0x1654AE6B, kTrackEntry = 0xAE, kTrackNumber = 0xD7,
                        kTrackUid = 0x73C5, kTrackType = 0x83, kFlagDefault = 0x88,
                        kFlagLacing = 0x9C, kDefaultDuration = 0x23E383, kTrackName = 0x536E,
                        kLanguage = 0x22B59C, kCodecId = 0x86, kCodecPrivate = 0x63A2,
                        kVideo = 0xE0, kPixelWidth = 0xB0, kPixelHeight = 0xBA,
                        kFlagInterlaced = 0x9A;
constexpr std::uint32_t kAttachments = 0x1941A469, kAttachedFile = 0x61A7, kFileName = 0x466E,
                        kFileMediaType = 0x4660, kFileData = 0x465C, kFileUid = 0x46AE;
constexpr std::uint32_t kCluster = 0x1F43B675, kTimestamp = 0xE7, kSimpleBlock = 0xA3;
constexpr std::uint32_t kCues = 0x1C53BB6B, kCuePoint = 0xBB, kCueTime = 0xB3,
                        kCueTrackPositions = 0xB7, kCueTrack = 0xF7, kCueClusterPosition = 0xF1;

// 2001-01-01T00:00:00Z, the epoch of Matroska dates, in nanoseconds since 1970.
constexpr Nanoseconds kMatroskaEpoch = 978'307'200 * kNanosecondsPerSecond;
constexpr Nanoseconds kMaxRelativeTime = 32767;  // of a block to its cluster
constexpr std::size_t kSeekHeadRoom = 256;
constexpr std::size_t kDurationRoom = 11;            // identifier, size, value
constexpr std::size_t kMaxClusterBytes = 64U << 20;  // held in memory

void put_binary(ebml::Writer& writer, std::uint32_t id, std::span<const std::byte> bytes) {
  writer.put_id(id);
  writer.put_size(bytes.size());
  writer.put_raw(bytes);
}

std::uint64_t unique_id(std::string_view text, std::uint64_t number) {
  return XXH3_64bits_withSeed(text.data(), text.size(), number) | 1;  // never 0
}

ebml::Writer track_entry(const MatroskaTrack& track, std::size_t number) {
  ebml::Writer video;
  video.put_uint(kFlagInterlaced, 2);  // progressive
  video.put_uint(kPixelWidth, static_cast<std::uint64_t>(track.width));
  video.put_uint(kPixelHeight, static_cast<std::uint64_t>(track.height));
  ebml::Writer entry;
  entry.put_uint(kTrackNumber, number);
  entry.put_uint(kTrackUid, unique_id(track.name, number));
  entry.put_uint(kTrackType, 1);  // video
  entry.put_uint(kFlagDefault, number == 1 ? 1 : 0);
  entry.put_uint(kFlagLacing, 0);
  entry.put_string(kLanguage, "und");
  entry.put_string(kTrackName, track.name);
  entry.put_string(kCodecId, track.codec_id);
  if (!track.codec_private.empty()) put_binary(entry, kCodecPrivate, track.codec_private);
  if (track.default_duration > 0) {
    entry.put_uint(kDefaultDuration, static_cast<std::uint64_t>(track.default_duration));
  }
  entry.put_master(kVideo, video);
  return entry;
}

ebml::Writer attachments_of(const MatroskaDescription& description) {
  ebml::Writer attachments;
  std::uint64_t number = 0;
  for (const MatroskaAttachment& attachment : description.attachments) {
    ebml::Writer file;
    file.put_string(kFileName, attachment.name);
    file.put_string(kFileMediaType, attachment.media_type);
    file.put_uint(kFileUid, unique_id(attachment.name, ++number));
    put_binary(file, kFileData, std::as_bytes(std::span(attachment.contents)));
    attachments.put_master(kAttachedFile, file);
  }
  return attachments;
}

/// Appends the number of a track as a variable-size integer (RFC 8794, section 4).
void put_track_number(ebml::Writer& writer, std::size_t number) {
  constexpr std::size_t kOneByte = 0x7F;
  if (number < kOneByte) {
    writer.put_big_endian(0x80 | number, 1);
  } else {
    writer.put_big_endian(0x4000 | number, 2);
  }
}

}  // namespace

struct MatroskaMovie::State {
  State(const std::filesystem::path& target, MatroskaDescription of)
      : description(std::move(of)),
        temporary(target),
        file(temporary.path(), OutputFile::Open::kExisting),
        name(target.string()) {}

  struct Cue {
    Nanoseconds time = 0;
    std::uint64_t cluster = 0;  ///< offset from segment_data
    std::vector<int> tracks;
  };

  MatroskaDescription description;
  TemporaryFile temporary;
  OutputFile file;
  std::string name;
  std::uint64_t end = 0;  ///< bytes written
  std::uint64_t segment_size_offset = 0, segment_data = 0, seek_head_offset = 0;
  std::uint64_t info_offset = 0, tracks_offset = 0, attachments_offset = 0, duration_offset = 0;
  std::vector<Cue> cues;
  ebml::Writer blocks;  ///< of the cluster that is not written yet
  Nanoseconds cluster_time = 0, last_time = 0;
  std::vector<int> cluster_tracks;
  struct TrackTimes {
    Nanoseconds last = -1, step = 0;
  };
  std::vector<TrackTimes> times;  ///< per track

  [[noreturn]] void fail() const {
    throw Error::from_errno("the movie cannot be written", name,
                            "Check the folder and the free disk space");
  }

  void write(std::span<const std::byte> bytes) {
    if (!file.write_at(end, bytes)) fail();
    end += bytes.size();
  }

  void write_header() {
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
    if (!description.title.empty()) info.put_string(kTitle, description.title);
    info.put_string(kMuxingApp, "raystage");
    info.put_string(kWritingApp, "raystage");
    const std::size_t duration_in_info = info.size();
    info.put_void(kDurationRoom);

    ebml::Writer tracks;
    std::size_t number = 0;
    for (const MatroskaTrack& track : description.tracks) {
      tracks.put_master(kTrackEntry, track_entry(track, ++number));
    }

    ebml::Writer header;
    header.put_master(kEbml, head);
    header.put_id(kSegment);
    segment_size_offset = header.size();
    header.put_size(ebml::kUnknownSize);
    segment_data = seek_head_offset = header.size();
    header.put_void(kSeekHeadRoom);
    info_offset = header.size();
    header.put_id(kInfo);
    header.put_size(info.size());
    duration_offset = header.size() + duration_in_info;
    header.put_raw(info.bytes());
    tracks_offset = header.size();
    header.put_master(kTracks, tracks);
    if (!description.attachments.empty()) {
      attachments_offset = header.size();
      header.put_master(kAttachments, attachments_of(description));
    }
    write(header.bytes());
  }

  void write_cluster() {
    if (blocks.size() == 0) return;
    cues.push_back({cluster_time, end - segment_data, std::move(cluster_tracks)});
    ebml::Writer time;
    time.put_uint(kTimestamp, static_cast<std::uint64_t>(cluster_time));
    ebml::Writer header;
    header.put_id(kCluster);
    header.put_size(time.size() + blocks.size());
    header.put_raw(time.bytes());
    write(header.bytes());
    write(blocks.bytes());
    blocks = {};
    cluster_tracks.clear();
  }

  ebml::Writer cues_element() const {
    ebml::Writer points;
    for (const Cue& cue : cues) {
      ebml::Writer point;
      point.put_uint(kCueTime, static_cast<std::uint64_t>(cue.time));
      for (const int track : cue.tracks) {
        ebml::Writer position;
        position.put_uint(kCueTrack, static_cast<std::uint64_t>(track) + 1);
        position.put_uint(kCueClusterPosition, cue.cluster);
        point.put_master(kCueTrackPositions, position);
      }
      points.put_master(kCuePoint, point);
    }
    ebml::Writer element;
    element.put_master(kCues, points);
    return element;
  }

  std::vector<std::byte> seek_head(std::uint64_t cues_offset) const {
    ebml::Writer seeks;
    const auto add = [&](std::uint32_t id, std::uint64_t offset) {
      ebml::Writer seek;
      seek.put_id(kSeekId);
      seek.put_big_endian(0x84, 1);  // four bytes follow
      seek.put_big_endian(id, 4);
      seek.put_uint(kSeekPosition, offset - segment_data);
      seeks.put_master(kSeek, seek);
    };
    add(kInfo, info_offset);
    add(kTracks, tracks_offset);
    if (attachments_offset > 0) add(kAttachments, attachments_offset);
    if (cues_offset > 0) add(kCues, cues_offset);
    ebml::Writer head;
    head.put_master(kSeekHead, seeks);
    head.put_void(kSeekHeadRoom - head.size());
    return {head.bytes().begin(), head.bytes().end()};
  }

  void patch(std::uint64_t offset, const ebml::Writer& bytes) {
    if (!file.write_at(offset, bytes.bytes())) fail();
  }
};

MatroskaMovie::MatroskaMovie(const std::filesystem::path& file, MatroskaDescription description) {
  const std::size_t tracks = description.tracks.size();
  if (tracks < 1 || tracks > kMaxTracks) {
    throw Error::bad_input(fmt::format("found {} tracks, allowed: 1 to {}", tracks, kMaxTracks),
                           file.string(), "Export fewer cameras");
  }
  state_ = std::make_unique<State>(file, std::move(description));
  state_->times.resize(tracks);
  state_->write_header();
}

MatroskaMovie::~MatroskaMovie() = default;

void MatroskaMovie::append(int track, Nanoseconds time, std::span<const std::byte> frame) {
  State& s = *state_;
  if (time < s.last_time || time > kMaxTime) {
    throw Error::bad_input(
        fmt::format("found the time {} ns, allowed: {} to {}", time, s.last_time, kMaxTime), s.name,
        "Begin the movie at its first frame instead of the epoch");
  }
  if (s.blocks.size() > 0 && (time - s.cluster_time > kMaxRelativeTime ||
                              s.blocks.size() + frame.size() > kMaxClusterBytes)) {
    s.write_cluster();
  }
  if (s.blocks.size() == 0) s.cluster_time = time;
  const auto number = static_cast<std::size_t>(track) + 1;
  ebml::Writer header;
  put_track_number(header, number);
  header.put_big_endian(static_cast<std::uint64_t>(time - s.cluster_time), 2);
  header.put_big_endian(0x80, 1);  // key frame, no lacing
  s.blocks.put_id(kSimpleBlock);
  s.blocks.put_size(header.size() + frame.size());
  s.blocks.put_raw(header.bytes());
  s.blocks.put_raw(frame);
  s.cluster_tracks.push_back(track);
  s.last_time = time;
  State::TrackTimes& times = s.times[track];
  if (times.last >= 0) times.step = time - times.last;
  times.last = time;
}

void MatroskaMovie::close() {
  State& s = *state_;
  s.write_cluster();
  Nanoseconds duration = 0;  // the last frame of a track lasts as long as the one before it
  for (std::size_t i = 0; i < s.times.size(); ++i) {
    const State::TrackTimes& times = s.times[i];
    if (times.last < 0) continue;
    const Nanoseconds step = times.step > 0 ? times.step : s.description.tracks[i].default_duration;
    duration = std::max(duration, times.last + step);
  }
  std::uint64_t cues_offset = 0;
  if (!s.cues.empty()) {
    cues_offset = s.end;
    s.write(s.cues_element().bytes());
  }
  if (duration > 0) {
    ebml::Writer bytes;
    bytes.put_float(kDuration, static_cast<double>(duration));
    s.patch(s.duration_offset, bytes);
  }
  if (!s.file.write_at(s.seek_head_offset, s.seek_head(cues_offset))) s.fail();
  ebml::Writer size;
  size.put_size(s.end - s.segment_data);
  s.patch(s.segment_size_offset, size);
  s.temporary.commit();
}

}  // namespace raystage::exports
