// SPDX-License-Identifier: Apache-2.0
// Merges the journal and the archive of a damaged pair into the records that can be saved. Corrects
// single flipped bits of records, checks every frame by its XXH3, finds moved frames by time and
// hash, and adds frames without a record. Input: the bytes of both files; output: records and
// losses. Cost: O(bytes of the archive), plus 8 x record bytes checks per damaged record.
#include "store/fixity/salvage.h"

#include <fmt/format.h>
#include <xxhash.h>

#include <algorithm>
#include <array>
#include <map>
#include <optional>
#include <set>
#include <tuple>
#include <utility>

#include "base/error.h"
#include "base/little_endian.h"
#include "store/journal.h"
#include "store/matroska.h"

namespace raystage::store {
namespace {

using Bytes = std::span<const std::byte>;
constexpr std::size_t kStatusAt = 20, kHashAt = 24;  // in a record, docs/formats/journal.md

std::uint64_t hash_of(Bytes archive, const FrameRecord& record) {
  return XXH3_64bits(archive.data() + record.offset, record.size);
}

// Returns the record with the one flipped bit corrected that makes its check pass, or nullopt. In
// version 2 there is at most one such bit.
std::optional<FrameRecord> mend(Bytes slot, std::uint32_t version) {
  std::array<std::byte, journal::kRecordBytes> bytes{};
  std::ranges::copy(slot, bytes.begin());
  const auto own = std::span(bytes).first(slot.size());
  for (std::size_t bit = 0; bit < 8 * own.size(); ++bit) {
    const auto mask = static_cast<std::byte>(1u << (bit % 8));
    own[bit / 8] ^= mask;
    if (const auto record = journal::decode_record(own, version)) return record;
    own[bit / 8] ^= mask;
  }
  return std::nullopt;
}

struct Journal {
  std::vector<FrameRecord> records;
  /// Hash fields of lost records, and whether their status field says that they are stored and
  /// verified.
  std::map<std::uint64_t, bool> stray_hashes;
  std::int64_t mended = 0, lost = 0;
};

// Reads the records of a journal and corrects flipped bits. With several flipped bits the
// correction may be wrong, so a corrected record must fit between the times of its neighbours.
Journal read_journal(Bytes file, std::uint32_t version) {
  const std::size_t step = journal::record_bytes(version);
  struct Slot {
    FrameRecord record;
    Bytes bytes;
    bool sound = false, mended = false;
  };
  std::vector<Slot> slots;
  for (Bytes rest = file.subspan(std::min(file.size(), journal::kHeaderBytes)); rest.size() >= step;
       rest = rest.subspan(step)) {
    Slot slot;
    slot.bytes = rest.first(step);
    auto record = journal::decode_record(slot.bytes, version);
    slot.sound = record.has_value();
    if (!record) {
      record = mend(slot.bytes, version);
      slot.mended = record.has_value();
    }
    if (record) slot.record = *record;
    slots.push_back(slot);
  }
  Nanoseconds next = matroska::kMaxTime;
  for (auto slot = slots.rbegin(); slot != slots.rend(); ++slot) {
    if (slot->sound) next = slot->record.time_ns;
    if (slot->mended && slot->record.time_ns > next) slot->mended = false;
  }
  Journal journal;
  Nanoseconds last = 0;
  for (const Slot& slot : slots) {
    if (slot.sound || (slot.mended && slot.record.time_ns >= last)) {
      last = slot.record.time_ns;
      journal.records.push_back(slot.record);
      journal.mended += slot.mended ? 1 : 0;
    } else {
      ++journal.lost;
      const bool is_verified = slot.bytes[kStatusAt] == std::byte{0};
      journal.stray_hashes.emplace(load_little_endian<std::uint64_t>(slot.bytes, kHashAt),
                                   is_verified);
    }
  }
  return journal;
}

void refuse_another_camera(const ArchivePair& pair) {
  const auto refuse = [&](const std::string& file, const std::string& what) {
    return Error::bad_input(what, file,
                            "Replace it with the file of camera \"" + pair.description.camera_id +
                                "\", or correct take.json");
  };
  if (pair.journal) {
    const auto header = journal::decode_header(*pair.journal, pair.journal_name);
    if (header && (header->epoch_utc != pair.description.epoch_utc ||
                   header->camera_hash != journal::hash_camera_id(pair.description.camera_id))) {
      throw refuse(pair.journal_name, "the journal is of another camera or take");
    }
  }
  ArchiveWriter::Description found;
  try {
    found = matroska::read_preamble(pair.archive, pair.archive_name).description;
  } catch (const Error&) {
    return;  // damaged: the header is written anew
  }
  // A single flipped bit in the id is damage, not another camera: the header also has the hash of
  // the id.
  if (!found.camera_id.empty() && found.camera_id != pair.description.camera_id &&
      matroska::begins_with(pair.archive, matroska::header_of_file(pair.archive, found))) {
    throw refuse(pair.archive_name, "the archive is of camera \"" + found.camera_id + "\"");
  }
}

bool was_closed(const ArchivePair& pair, const matroska::Header& header) {
  const std::size_t begin = header.segment_size_offset, end = header.segment_data_offset;
  return pair.archive.size() >= end &&
         !std::ranges::equal(pair.archive.subspan(begin, end - begin),
                             Bytes(header.bytes).subspan(begin, end - begin));
}

class Salvager {
 public:
  explicit Salvager(const ArchivePair& pair)
      : pair_(pair),
        archive_(pair.archive),
        header_(header_of_pair(pair)),
        found_(matroska::find_clusters(archive_, 0)) {
    std::ranges::stable_sort(found_, {}, &matroska::FoundFrame::time);
    if (pair.journal) {
      journal_ = read_journal(*pair.journal, journal_version(*pair.journal, pair.journal_name));
    } else {
      lose(kUnknownTime, "the journal: arrival times and missing frames are unknown");
    }
    result_.corrected_records = journal_.mended;
  }

  SalvageResult run() {
    for (const FrameRecord& record : journal_.records) take_record(record);
    std::ranges::sort(places_, {}, &Place::begin);
    take_unlisted();
    for (const auto& [offset, size] : rotten_) occupy(static_cast<std::size_t>(offset), size);
    std::ranges::sort(places_, {}, &Place::begin);
    put_in_order();
    count_losses();
    return std::move(result_);
  }

 private:
  struct Place {
    std::size_t begin, end;  // of a cluster, in the archive
  };

  void lose(Nanoseconds time, std::string what) {
    result_.losses.push_back({time, std::move(what)});
  }
  bool lies_within(const FrameRecord& record) const {
    return record.size > 0 && record.offset >= matroska::kClusterHeaderBytes &&
           record.offset <= archive_.size() && record.size <= archive_.size() - record.offset;
  }
  // Returns the hash of the frame that a record states; nullopt if it lies outside of the archive.
  // Frames do not overlap, but the records and clusters of hostile files may all state the whole
  // archive: nullopt also beyond that work.
  std::optional<std::uint64_t> stated_hash(const FrameRecord& record) {
    constexpr std::uint64_t kMaxOverlap = 16;
    if (!lies_within(record)) return std::nullopt;
    if (record.size > kMaxOverlap * archive_.size() - hashed_bytes_) return std::nullopt;
    hashed_bytes_ += record.size;
    return hash_of(archive_, record);
  }
  void occupy(std::size_t offset, std::size_t size) {
    places_.push_back({offset - matroska::kClusterHeaderBytes, offset + size});
  }

  // Finds the frame at the journal's offset or, if bytes were lost or inserted before it, at the
  // first cluster with this time, size and hash.
  bool locate(FrameRecord& record) {
    if (stated_hash(record) == record.xxh3) return true;
    if (hashed_times_.insert(record.time_ns).second) hash_found(record.time_ns);
    const auto moved = offsets_.find({record.time_ns, record.size, record.xxh3});
    if (moved == offsets_.end()) return false;
    record.offset = moved->second;
    return true;
  }
  // Hashes the clusters of a time, each once, however many records state this time.
  void hash_found(Nanoseconds time) {
    auto frame = std::ranges::lower_bound(found_, time, {}, &matroska::FoundFrame::time);
    for (; frame != found_.end() && frame->time == time; ++frame) {
      const FrameRecord record{time, frame->offset, static_cast<std::uint32_t>(frame->size)};
      if (const auto hash = stated_hash(record)) {
        offsets_.try_emplace({time, record.size, *hash}, record.offset);
      }
    }
  }

  void take_record(FrameRecord record) {
    if (record.time_ns < 0 || record.time_ns > matroska::kMaxTime) {
      ++journal_.lost;
      return;
    }
    if (record.status == FrameStatus::kStored) {
      listed_times_.insert(record.time_ns);
      last_listed_ = std::max(last_listed_, record.offset);
      if (locate(record)) {
        occupy(static_cast<std::size_t>(record.offset), record.size);
      } else {
        const bool rotten = lies_within(record);
        ++(rotten ? result_.corrupt_frames : result_.truncated_frames);
        lose(record.time_ns, rotten ? "a frame is corrupt: its XXH3 differs"
                                    : "a frame is beyond the archive's end");
        if (rotten) rotten_.emplace(record.offset, record.size);
        result_.lost_hashes.emplace(record.time_ns, record.xxh3);
        if (record.is_unverified) result_.lost_unverified_times.insert(record.time_ns);
        record.status = FrameStatus::kTorn;
        record.is_unverified = false;
      }
    }
    if (record.status != FrameStatus::kStored) record.offset = record.size = record.xxh3 = 0;
    result_.records.push_back(record);
  }

  // Returns whether a record accounts for the frame: by its time, its offset and size, or overlap
  // with a saved or corrupt frame.
  bool is_taken(const matroska::FoundFrame& frame) const {
    if (listed_times_.contains(frame.time)) return true;
    if (rotten_.contains({frame.offset, static_cast<std::uint32_t>(frame.size)})) return true;
    const auto after =
        std::ranges::lower_bound(places_, frame.offset + frame.size, {}, &Place::begin);
    return after != places_.begin() && std::prev(after)->end > frame.offset;
  }

  // Adds frames without a record.
  void take_unlisted() {
    std::erase_if(found_, [&](const matroska::FoundFrame& frame) { return is_taken(frame); });
    // A write that was interrupted between a frame and its record leaves such a frame at the end.
    const bool are_last =
        std::ranges::all_of(found_, [&](const auto& frame) { return frame.offset > last_listed_; });
    const bool by_a_crash = found_.size() <= journal::kMaxTrustedUnlistedFrames && are_last &&
                            pair_.journal && journal_.lost == 0 && !was_closed(pair_, header_);
    for (const auto& frame : found_) {
      FrameRecord record{frame.time, frame.offset, static_cast<std::uint32_t>(frame.size)};
      const auto hash = stated_hash(record);
      if (!hash) continue;
      record.xxh3 = *hash;
      ++result_.reindexed_frames;
      const auto stray = journal_.stray_hashes.find(record.xxh3);
      if (stray != journal_.stray_hashes.end()) {
        --journal_.lost;
        record.is_unverified = !stray->second;
      } else if (!by_a_crash) {
        ++result_.unverified_frames;
        result_.unverified_times.insert(frame.time);
        record.is_unverified = true;
        lose(frame.time, "a frame's record is lost: the frame cannot be verified");
      }
      occupy(frame.offset, frame.size);
      result_.records.push_back(record);
    }
  }

  void put_in_order() {
    std::ranges::stable_sort(result_.records, {}, &FrameRecord::time_ns);
    Nanoseconds last = -1;
    std::erase_if(result_.records, [&](const FrameRecord& record) {
      if (record.status != FrameStatus::kStored) return false;
      if (record.time_ns == last) {
        lose(last, "the second of two frames at one time");
        return true;
      }
      last = record.time_ns;
      ++result_.frames;
      return false;
    });
  }

  void count_losses() {
    result_.lost_records = std::max<std::int64_t>(0, journal_.lost);
    if (result_.lost_records > 0) {
      lose(kUnknownTime,
           fmt::format("{} records of the journal; missing frames in them are unknown",
                       result_.lost_records));
    }
    std::size_t cursor = std::min(header_.bytes.size(), archive_.size());
    const auto skip_to = [&](std::size_t end) {
      if (end <= cursor) return;
      result_.lost_bytes += end - cursor;
      lose(kUnknownTime, fmt::format("{} bytes at {} of the archive are not a whole frame",
                                     end - cursor, cursor));
    };
    for (const Place& place : places_) {
      skip_to(place.begin);
      cursor = std::max(cursor, place.end);
    }
    const Bytes tail = archive_.subspan(cursor);
    const Bytes cues = Bytes(matroska::kCuesIdBytes).first(std::min<std::size_t>(tail.size(), 4));
    if (!std::ranges::equal(tail.first(cues.size()), cues)) skip_to(archive_.size());
  }

  const ArchivePair& pair_;
  Bytes archive_;
  matroska::Header header_;
  std::vector<matroska::FoundFrame> found_;  // by time
  Journal journal_;
  std::uint64_t hashed_bytes_ = 0;      // of frames that records or clusters state
  std::set<Nanoseconds> hashed_times_;  // whose clusters are in offsets_
  /// Offsets of frames by time, size and XXH3.
  std::map<std::tuple<Nanoseconds, std::uint32_t, std::uint64_t>, std::uint64_t> offsets_;
  std::set<Nanoseconds> listed_times_;
  std::uint64_t last_listed_ = 0;  // offset of the last frame in the journal
  std::vector<Place> places_;      // of saved frames, at the end also of corrupt ones
  std::set<std::pair<std::uint64_t, std::uint32_t>> rotten_;  // offset and size
  SalvageResult result_;
};

}  // namespace

SalvageResult salvage_archive(const ArchivePair& pair) {
  refuse_another_camera(pair);
  return Salvager(pair).run();
}

}  // namespace raystage::store
