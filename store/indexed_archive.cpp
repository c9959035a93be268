// SPDX-License-Identifier: Apache-2.0
// Reads stored frames. The journal is their index (archive_index.h), made through a memory map;
// frames are copied from the file, because another process may truncate it.
#include "store/indexed_archive.h"

#include <xxhash.h>

#include <algorithm>
#include <cassert>
#include <string>

namespace raystage::store {

void IndexedArchive::include_lost() {
  const auto middle = static_cast<std::ptrdiff_t>(index.frames.size());
  for (const ArchiveIndex::LostFrame& lost : index.lost) {
    index.records[lost.record] = lost.listed;
    index.frames.push_back(lost.listed);
  }
  std::ranges::inplace_merge(index.frames, index.frames.begin() + middle, {},
                             &FrameRecord::time_ns);
  forget_checks();
  for (const ArchiveIndex::LostFrame& lost : index.lost) {
    const auto at =
        std::ranges::lower_bound(index.frames, lost.listed.time_ns, {}, &FrameRecord::time_ns);
    integrity[static_cast<std::size_t>(at - index.frames.begin())] = Integrity::kLost;
  }
}

void IndexedArchive::forget_checks() {
  integrity = std::make_unique<std::atomic<Integrity>[]>(index.frames.size());
}

const FrameRecord& IndexedArchive::record(int frame) const {
  assert(frame >= 0 && static_cast<std::size_t>(frame) < index.frames.size());
  return index.frames[frame];
}

bool IndexedArchive::has_recorded_hash(int frame, const FrameBytes& bytes) const {
  return XXH3_64bits(bytes.data(), bytes.size()) == record(frame).xxh3;
}

FrameBytes IndexedArchive::read(int frame) const {
  const FrameRecord& wanted = record(frame);
  if (wanted.size > kMaxFrameBytes) {
    throw Error::bad_input("frame " + std::to_string(frame) + " has more than 256 MiB",
                           path.string(), "Run `raystage verify` on the take");
  }
  const std::shared_ptr<std::byte[]> bytes = buffers->take(wanted.size);
  if (file->read_at(wanted.offset, {bytes.get(), wanted.size}) != wanted.size)
    throw unreadable(frame);
  return {bytes, wanted.size};
}

std::optional<FrameBytes> IndexedArchive::read_intact(int frame) const {
  std::atomic<Integrity>& known = integrity[frame];
  if (known == Integrity::kRotten || known == Integrity::kLost) return std::nullopt;
  FrameBytes bytes = read(frame);
  if (known != Integrity::kIntact) {  // another thread may have found rot meanwhile
    const bool is_intact = record(frame).xxh3 == 0 || has_recorded_hash(frame, bytes);
    known = is_intact ? Integrity::kIntact : Integrity::kRotten;
    if (!is_intact) return std::nullopt;
  }
  return bytes;
}

template <std::size_t kBytes>
std::optional<std::array<std::byte, kBytes>> IndexedArchive::start_of(int frame) const {
  const FrameRecord& wanted = record(frame);
  std::array<std::byte, kBytes> start{};
  if (wanted.size < start.size() || is_lost(frame)) return std::nullopt;
  if (file->read_at(wanted.offset, start) != start.size()) throw unreadable(frame);
  return start;
}

std::optional<JpegFixity> IndexedArchive::packed_fixity(int frame) const {
  const auto start = may_have_packed_frames() ? start_of<kPackedHeaderBytes>(frame) : std::nullopt;
  return start ? read_jpeg_fixity(*start) : std::nullopt;
}

std::optional<FrameLink> IndexedArchive::link_of(int frame) const {
  const bool may_have_links = is_temporal(index.description.codec);
  const auto start = may_have_links ? start_of<kFrameLinkBytes>(frame) : std::nullopt;
  return start ? read_frame_link(*start) : std::nullopt;
}

Error IndexedArchive::unreadable(int frame) const {
  return Error::bad_input("frame " + std::to_string(frame) + " cannot be read", path.string(),
                          "Check the disk and run `raystage verify` on the take");
}

RottenFrame IndexedArchive::rotten_frame(int frame) const {
  const std::string& camera = index.description.camera_id;  // empty if the header is damaged
  std::string what = "frame " + std::to_string(frame) +
                     (camera.empty() ? " " : " of camera \"" + camera + "\" ") +
                     std::string(kRottenFrameText);
  const bool is_beyond_end = is_lost(frame);
  if (is_beyond_end) what += ": the archive ends before it";
  const std::string repair = is_beyond_end ? "`raystage repair --from COPY`" : "`raystage repair`";
  return {
      Error::bad_input(what, path.string(), "Run `raystage verify` on the take, then " + repair),
      frame};
}

}  // namespace raystage::store
