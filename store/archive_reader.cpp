// SPDX-License-Identifier: Apache-2.0
// Reads an archive (indexed_archive.h) and decodes what is not stored as JPEG. The nearest frame to
// a time is found by binary search; frames on another host come from RemoteFrames. Packed frames
// are checked like others, then unpacked (store/jpegxl/), and kept for the next request.
#include <algorithm>
#include <cassert>
#include <iterator>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include "base/contained_path.h"
#include "base/error.h"
#include "base/mapped_file.h"
#include "store/archive.h"
#include "store/camera_groups.h"
#include "store/indexed_archive.h"
#include "store/jpeg/encode.h"
#include "store/jpegxl/frame_packer.h"
#include "store/jpegxl/packed_frame.h"
#include "store/jpegxl/picture_codec.h"
#include "store/pixel_light.h"
#include "store/temporal/group_decoder.h"
#include "store/temporal/temporal_frame.h"

namespace raystage::store {

struct ArchiveReader::State : IndexedArchive {
  State() = default;
  State(const ContainedPath& archive, std::shared_ptr<FrameBuffers> with_buffers,
        std::shared_ptr<UnpackedFrames> with_unpacked)
      : IndexedArchive(archive, std::move(with_buffers)),
        unpacked(std::move(with_unpacked)),
        number(unpacked->new_archive()) {}

  bool has_pictures() const { return index.description.codec == FrameCodec::kPicture; }

  /// Returns the frames of a group from its first to a frame and, if `is_whole`, on to the last
  /// that is intact; none if one up to the frame is not, or was lost.
  std::vector<FrameBytes> read_group(int frame, std::uint32_t position, bool is_whole) const {
    std::vector<FrameBytes> frames;
    std::uint64_t bytes_of_group = 0;
    if (std::int64_t{position} > frame) return {};
    for (int i = frame - static_cast<int>(position); i < static_cast<int>(index.frames.size());
         ++i) {
      if (i > frame && (!is_whole || frames.size() == kMaxGroupFrames)) break;
      bytes_of_group += record(i).size;
      const bool has_room = bytes_of_group <= kMaxGroupBytes;
      const std::optional<FrameBytes> bytes = has_room ? read_intact(i) : std::nullopt;
      const auto link = bytes ? read_frame_link(*bytes) : std::nullopt;
      const bool follows = link && link->position == frames.size() &&
                           (frames.empty() || link->previous == hash_of_stored(frames.back()));
      if (!follows && i <= frame) return {};
      if (!follows) break;
      frames.push_back(*bytes);
    }
    return frames;
  }

  /// Decodes a group and keeps its pictures as JPEGs; returns that at `position`. `key_of`: of each
  /// member.
  template <class KeyOf>
  FrameBytes decode_group(const std::vector<std::span<const std::byte>>& group,
                          std::size_t position, const KeyOf& key_of) const {
    const ArchiveWriter::Description& description = index.description;
    auto jpegs = unpacked->groups().decode(video_codec_of(description.codec),
                                           {description.width, description.height}, group, path);
    FrameBytes wanted;
    // The frames that a shot shows next are evicted last.
    for (std::size_t i = jpegs.size(); i-- > 0;) {
      const FrameBytes jpeg(std::make_shared<const std::vector<std::byte>>(std::move(jpegs[i])));
      if (i == position) wanted = jpeg;
      unpacked->insert(key_of(static_cast<int>(i)), jpeg);
    }
    return wanted;
  }

  /// Returns the picture of a temporal frame as a JPEG, and keeps those of its group; none if the
  /// group is damaged up to it.
  std::optional<FrameBytes> decode_temporal(int frame, std::uint32_t position) const {
    // Threads that want frames of one group wait for the first.
    const std::scoped_lock lock(*decoding);
    if (auto known = unpacked->find({number, frame})) return known;
    const std::vector<FrameBytes> frames = read_group(frame, position, true);
    if (frames.empty()) return std::nullopt;
    const int first = frame - static_cast<int>(position);
    return decode_as_far_as_possible({frames.begin(), frames.end()}, position, [&](int i) {
      return UnpackedFrames::Key{number, first + i};
    });
  }

  /// As decode_group(); without the frames after `position` if they cannot be decoded.
  template <class KeyOf>
  FrameBytes decode_as_far_as_possible(const std::vector<std::span<const std::byte>>& group,
                                       std::size_t position, const KeyOf& key_of) const {
    try {
      return decode_group(group, position, key_of);
    } catch (const Error& error) {
      if (error.exit_code() != ExitCode::kBadInput || group.size() == position + 1) throw;
    }
    const auto end = group.begin() + static_cast<std::ptrdiff_t>(position) + 1;
    return decode_group({group.begin(), end}, position, key_of);
  }

  /// Returns the frames of other cameras, and this one, that a frame is decoded with.
  std::vector<GroupMember> read_camera_group(int frame) const {
    if (take == nullptr) {
      throw Error::bad_input("the frames refer to those of other cameras", path.string(),
                             "Open the archive as part of its take");
    }
    return group_up_to(*take, camera_in_take, frame);
  }

  /// As decode_temporal(), of a group across cameras.
  std::optional<FrameBytes> decode_camera_group(int frame) const {
    std::vector<GroupMember> group = read_camera_group(frame);
    if (group.empty()) return std::nullopt;
    const std::scoped_lock lock(unpacked->group_mutex(hash_of_stored(group.front().bytes)));
    if (auto known = unpacked->find({number, frame})) return known;
    const std::size_t position = group.size() - 1;
    extend_group(*take, group);  // views need all cameras of a time
    std::vector<std::span<const std::byte>> frames;
    for (const GroupMember& member : group) frames.emplace_back(member.bytes);
    return decode_as_far_as_possible(frames, position, [&](int i) {
      const GroupMember& member = group[static_cast<std::size_t>(i)];
      return UnpackedFrames::Key{take->archive(member.camera).state_->number, member.frame};
    });
  }

  /// Returns the JPEG of a frame; none if its bytes are not the recorded ones or cannot be
  /// unpacked.
  std::optional<FrameBytes> read_intact_jpeg(int frame) const {
    if (has_pictures()) return read_jpeg_of_picture(frame);
    if (is_temporal(index.description.codec)) return read_temporal(frame);
    if (!may_have_packed_frames()) return read_intact(frame);
    if (auto known = unpacked->find({number, frame})) return known;
    const std::optional<FrameBytes> stored = read_intact(frame);
    if (!stored || !is_jpeg_xl(*stored)) return stored;
    try {
      const FrameBytes jpeg(
          std::make_shared<const std::vector<std::byte>>(unpacked->packer().unpack(
              *stored, {index.description.width, index.description.height}, path)));
      unpacked->insert({number, frame}, jpeg);
      return jpeg;
    } catch (const Error& error) {
      if (error.exit_code() != ExitCode::kBadInput) throw;
      mark_rotten(frame);
      return std::nullopt;
    }
  }

  /// Returns a frame of an archive of pictures; none if its bytes are not the recorded ones or
  /// cannot be decoded.
  std::optional<DeepPicture> read_picture(int frame) const {
    const std::optional<FrameBytes> stored = remote ? remote->jpeg(frame) : read_intact(frame);
    if (!stored) return std::nullopt;
    try {
      const ArchiveWriter::Description& camera = index.description;
      return unpacked->pictures().decode(*stored, camera.width, camera.height,
                                         encoding ? &*encoding : nullptr, path);
    } catch (const Error& error) {
      if (error.exit_code() != ExitCode::kBadInput) throw;
      mark_rotten(frame);
      return std::nullopt;
    }
  }

  std::optional<FrameBytes> read_temporal(int frame) const {
    if (auto known = unpacked->find({number, frame})) return known;
    const std::optional<FrameBytes> stored = read_intact(frame);
    const auto link = stored ? read_frame_link(*stored) : std::nullopt;
    if (!link) return stored;
    try {
      return refers_to_cameras(index.description.codec) ? decode_camera_group(frame)
                                                        : decode_temporal(frame, link->position);
    } catch (const Error& error) {
      if (error.exit_code() != ExitCode::kBadInput) throw;
      mark_rotten(frame);
      return std::nullopt;
    }
  }

  /// Returns a JPEG to look at.
  std::optional<FrameBytes> read_jpeg_of_picture(int frame) const {
    if (auto known = unpacked->find({number, frame})) return known;
    if (!encoding) {
      throw Error::bad_input(
          "the frames are JPEG XL pictures, but the meaning of their samples is "
          "not known",
          path.string(), "Open the archive as part of its take");
    }
    const std::optional<DeepPicture> picture = read_picture(frame);
    if (!picture) return std::nullopt;
    const FrameBytes jpeg(std::make_shared<const std::vector<std::byte>>(
        encode_jpeg(codes_from_picture(*picture, *encoding), {})));
    unpacked->insert({number, frame}, jpeg);
    return jpeg;
  }

  /// Returns whether the bytes of a frame, and of those that it refers to, are not the recorded
  /// ones.
  bool is_rotten(int frame) const {
    const std::optional<FrameBytes> stored = read_intact(frame);
    if (!stored || !is_temporal(index.description.codec)) return !stored;
    const auto link = read_frame_link(*stored);
    if (!link) return false;
    return refers_to_cameras(index.description.codec)
               ? read_camera_group(frame).empty()
               : read_group(frame, link->position, false).empty();
  }

  std::shared_ptr<UnpackedFrames> unpacked;
  std::uint64_t number = 0;  // of this archive in `unpacked`
  std::shared_ptr<const RemoteFrames> remote;
  std::optional<schemas::PixelEncoding> encoding;
  const TakeArchives* take = nullptr;  // null: unknown
  int camera_in_take = 0;
  std::unique_ptr<std::mutex> decoding = std::make_unique<std::mutex>();  // of one group at a time
};

namespace {

ArchiveIndex index_files(const MappedFile& archive, const std::optional<MappedFile>& journal,
                         const std::filesystem::path& archive_path,
                         const std::filesystem::path& journal_path) {
  const auto index = [&](const std::optional<std::span<const std::byte>>& journal_bytes) {
    return index_archive(archive.bytes(), journal_bytes, archive_path.string(),
                         journal_path.string());
  };
  if (!journal) return read_mapped([&] { return index(std::nullopt); }, archive);
  return read_mapped([&] { return index(journal->bytes()); }, archive, *journal);
}

}  // namespace

ArchiveReader::ArchiveReader(const std::filesystem::path& archive,
                             const std::filesystem::path& journal)
    : ArchiveReader(ContainedPath{archive.parent_path(), archive.filename()},
                    ContainedPath{journal.parent_path(), journal.filename()}) {}

ArchiveReader::ArchiveReader(const ContainedPath& archive, const ContainedPath& journal,
                             std::shared_ptr<FrameBuffers> buffers,
                             std::shared_ptr<UnpackedFrames> unpacked) {
  // Read the journal first: during a recording each of its records then has its frame.
  std::optional<MappedFile> journal_file;
  if (exists(journal)) journal_file.emplace(journal);
  state_ = std::make_unique<State>(
      archive, buffers ? std::move(buffers) : std::make_shared<FrameBuffers>(),
      unpacked ? std::move(unpacked) : std::make_shared<UnpackedFrames>());
  state_->index = index_files(MappedFile(*state_->file, archive.path()), journal_file,
                              archive.path(), journal.path());
  state_->include_lost();
}

ArchiveReader::ArchiveReader(const ArchiveWriter::Description& description,
                             std::vector<FrameRecord> records,
                             std::shared_ptr<const RemoteFrames> remote,
                             std::shared_ptr<UnpackedFrames> unpacked)
    : state_(std::make_unique<State>()) {
  assert(remote != nullptr || records.empty());
  state_->path = "camera " + description.camera_id;
  state_->remote = std::move(remote);
  state_->index.description = description;
  std::ranges::copy_if(records, std::back_inserter(state_->index.frames),
                       [](const FrameRecord& r) { return r.status == FrameStatus::kStored; });
  state_->index.records = std::move(records);
  state_->index.closed = true;
  state_->forget_checks();
  state_->unpacked = unpacked ? std::move(unpacked) : std::make_shared<UnpackedFrames>();
  state_->number = state_->unpacked->new_archive();
}

ArchiveReader::~ArchiveReader() = default;
ArchiveReader::ArchiveReader(ArchiveReader&&) noexcept = default;
ArchiveReader& ArchiveReader::operator=(ArchiveReader&&) noexcept = default;

std::span<const FrameRecord> ArchiveReader::records() const { return state_->index.records; }

std::span<const FrameRecord> ArchiveReader::frames() const { return state_->index.frames; }

std::optional<int> ArchiveReader::nearest_frame(Nanoseconds time) const {
  const auto frames = this->frames();
  if (frames.empty()) return std::nullopt;
  const auto after = std::ranges::lower_bound(frames, time, {}, &FrameRecord::time_ns);
  const auto index = static_cast<int>(after - frames.begin());
  if (after == frames.begin()) return 0;
  if (after == frames.end()) return index - 1;
  // Unsigned, as `time` may have any value.
  const auto ahead = static_cast<std::uint64_t>(after->time_ns) - static_cast<std::uint64_t>(time);
  const auto behind =
      static_cast<std::uint64_t>(time) - static_cast<std::uint64_t>(std::prev(after)->time_ns);
  return behind <= ahead ? index - 1 : index;
}

FrameBytes ArchiveReader::jpeg(int frame) const {
  if (std::optional<FrameBytes> bytes = intact_jpeg(frame)) return *std::move(bytes);
  throw state_->rotten_frame(frame);
}

FrameBytes ArchiveReader::stored(int frame) const {
  if (std::optional<FrameBytes> bytes = intact_stored(frame)) return *std::move(bytes);
  throw state_->rotten_frame(frame);
}

std::optional<FrameBytes> ArchiveReader::intact_stored(int frame) const {
  return state_->remote ? state_->remote->jpeg(frame) : state_->read_intact(frame);
}

void ArchiveReader::set_take(const TakeArchives& take, int camera) {
  state_->take = &take;
  state_->camera_in_take = camera;
}

DeepPicture ArchiveReader::picture(int frame) const {
  if (std::optional<DeepPicture> picture = state_->read_picture(frame)) return *std::move(picture);
  throw state_->rotten_frame(frame);
}

const std::optional<schemas::PixelEncoding>& ArchiveReader::pixel_encoding() const {
  return state_->encoding;
}

void ArchiveReader::set_pixel_encoding(const schemas::PixelEncoding& encoding) {
  state_->encoding = encoding;
}

std::optional<FrameBytes> ArchiveReader::intact_jpeg(int frame) const {
  const bool is_jpeg_elsewhere = state_->remote && !state_->has_pictures();
  return is_jpeg_elsewhere ? state_->remote->jpeg(frame) : state_->read_intact_jpeg(frame);
}

JpegLayout ArchiveReader::layout(int frame, std::string_view name) const {
  return state_->remote ? state_->remote->layout(frame) : parse_jpeg_layout(jpeg(frame), name);
}

FrameBytes ArchiveReader::jpeg_part(int frame, const JpegLayout& layout,
                                    const McuMask& wanted) const {
  const bool is_part = state_->remote && layout.regions_decodable() && !wanted.empty();
  return is_part ? state_->remote->jpeg_part(frame, layout, wanted) : jpeg(frame);
}

bool ArchiveReader::is_remote() const { return !state_->file.has_value(); }

void ArchiveReader::shift_times(Nanoseconds by) {
  for (auto* records : {&state_->index.records, &state_->index.frames}) {
    for (FrameRecord& record : *records) {
      record.time_ns += by;
      if (record.arrival_ns != kUnknownTime &&
          __builtin_add_overflow(record.arrival_ns, by, &record.arrival_ns)) {
        record.arrival_ns = kUnknownTime;  // journals may state any arrival
      }
    }
  }
}

void ArchiveReader::read_ahead(int frame) const {
  const FrameRecord& wanted = state_->record(frame);
  if (state_->file) state_->file->read_ahead(wanted.offset, wanted.size);
}

bool ArchiveReader::is_rotten(int frame) const {
  if (state_->remote) return state_->remote->jpeg(frame).size() == 0;
  const bool is_known =
      state_->is_known_intact(frame) && !is_temporal(state_->index.description.codec);
  return !is_known && state_->is_rotten(frame);
}

bool ArchiveReader::verify_frame(int frame) const {
  return state_->has_recorded_hash(frame, state_->remote ? stored(frame) : state_->read(frame));
}

namespace {

/// Returns whether stored frames have other bytes than the JPEGs that they were made from.
bool is_repacked(FrameCodec codec) { return codec == FrameCodec::kPacked || is_temporal(codec); }

}  // namespace

std::uint64_t ArchiveReader::jpeg_xxh3(int frame) const {
  if (state_->is_lost(frame) && is_repacked(description().codec)) return 0;
  const auto packed = state_->remote ? std::nullopt : state_->packed_fixity(frame);
  return packed ? packed->xxh3 : state_->record(frame).xxh3;
}

std::uint64_t ArchiveReader::recorded_xxh3(int frame) const {
  if (state_->remote) {
    const std::uint64_t recorded = state_->remote->recorded_xxh3(frame);
    return recorded != 0 ? recorded : jpeg_xxh3(frame);
  }
  const auto link = state_->link_of(frame);
  return link ? link->source_xxh3 : jpeg_xxh3(frame);
}

bool ArchiveReader::is_packed(int frame) const {
  return !state_->remote && state_->packed_fixity(frame).has_value();
}

const ArchiveWriter::Description& ArchiveReader::description() const {
  return state_->index.description;
}

bool ArchiveReader::was_closed() const { return state_->index.closed; }
std::uint64_t ArchiveReader::bytes() const { return state_->file ? state_->file->size() : 0; }
int ArchiveReader::recovered_frames() const { return state_->index.recovered; }
int ArchiveReader::damaged_records() const { return state_->index.damaged_records; }

}  // namespace raystage::store
