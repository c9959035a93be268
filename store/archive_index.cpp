// SPDX-License-Identifier: Apache-2.0
// Merges a journal with its archive: uses each record that is consistent, and scans the Matroska
// clusters in the gaps between records and after the last. Input: the bytes of both files; output:
// the records and stored frames. Cost: linear in the records, and in the bytes of the gaps.
#include "store/archive_index.h"

#include <xxhash.h>

#include <algorithm>
#include <string>

#include "base/error.h"
#include "store/journal.h"
#include "store/jpegxl/packed_frame.h"
#include "store/matroska.h"

namespace raystage::store {
namespace {

using Bytes = std::span<const std::byte>;

FrameRecord without_frame(const FrameRecord& record, FrameStatus status) {
  return {record.time_ns, 0, 0, status, 0, record.arrival_ns, record.sequence};
}

// Merges journal records, in file order, with frames found by scanning. Times must not decrease;
// times and offsets of stored frames must increase.
class Merger {
 public:
  Merger(Bytes archive, const matroska::Preamble& preamble, ArchiveIndex& index)
      : archive_(archive),
        // With a damaged header the clusters may still be whole. A truncated header leaves no
        // clusters, but the journal still lists the frames.
        cursor_(preamble.first_cluster.value_or(0)),
        keeps_lost_(preamble.is_cut),
        index_(index) {}

  void add(const FrameRecord& record) {
    if (record.time_ns < last_time_ || record.time_ns > matroska::kMaxTime) {
      ++index_.damaged_records;
      return;
    }
    if (record.status != FrameStatus::kStored) {
      accept(without_frame(record, record.status));
      return;
    }
    if (record.time_ns <= last_stored_time_) {
      ++index_.damaged_records;
      return;
    }
    constexpr std::size_t kHeader = matroska::kClusterHeaderBytes;
    if (record.size == 0 || record.offset < cursor_ + kHeader) {
      ++index_.damaged_records;
      return;
    }
    if (record.offset > archive_.size() || record.size > archive_.size() - record.offset) {
      cut_off_.push_back(record);
      cut_off_.back().status = FrameStatus::kTorn;
      last_time_ = record.time_ns;
      return;
    }
    const auto offset = static_cast<std::size_t>(record.offset);
    // Clusters are contiguous: a gap holds frames whose records are lost.
    if (offset > cursor_ + kHeader) recover(offset - kHeader, record.time_ns);
    accept(record);
    last_stored_time_ = record.time_ns;
    cursor_ = offset + record.size;
  }

  void finish() {
    recover(archive_.size(), matroska::kMaxTime + 1);
    // Recovered frames go between records of missing ones; the rest is in the journal's order.
    std::ranges::stable_sort(index_.records, {}, &FrameRecord::time_ns);
    // Truncated frames are missing, unless the scan found them.
    std::vector<Nanoseconds> stored_times;
    for (const FrameRecord& record : index_.records) {
      if (record.status == FrameStatus::kStored) stored_times.push_back(record.time_ns);
    }
    std::erase_if(cut_off_, [&](const FrameRecord& record) {
      return std::ranges::binary_search(stored_times, record.time_ns);
    });
    const auto middle = static_cast<std::ptrdiff_t>(index_.records.size());
    index_.records.insert(index_.records.end(), cut_off_.begin(), cut_off_.end());
    std::ranges::inplace_merge(index_.records, index_.records.begin() + middle, {},
                               &FrameRecord::time_ns);
    for (std::size_t i = 0; i < index_.records.size(); ++i) {
      FrameRecord& record = index_.records[i];
      if (record.status == FrameStatus::kStored || record.size == 0) continue;
      // Cut off.
      const bool follows =
          index_.lost.empty() || record.time_ns > index_.lost.back().listed.time_ns;
      if (keeps_lost_ && follows && record.size <= kMaxFrameBytes) {
        index_.lost.push_back({i, record});
        index_.lost.back().listed.status = FrameStatus::kStored;
      }
      record = without_frame(record, FrameStatus::kTorn);
    }
  }

 private:
  void recover(std::size_t end, Nanoseconds before) {
    const auto found = matroska::scan_clusters(archive_, cursor_, end);
    for (std::size_t i = 0; i < found.size(); ++i) {
      const auto& frame = found[i];
      // A frame that extends beyond the gap is not a frame.
      if (frame.time <= last_stored_time_ || frame.time >= before ||
          frame.offset + frame.size > end) {
        continue;
      }
      // A damaged time stamp must not hide all later frames.
      if (i + 1 < found.size() && found[i + 1].time <= frame.time &&
          found[i + 1].time > last_stored_time_) {
        continue;
      }
      // Hash 0: unknown.
      accept({frame.time, frame.offset, static_cast<std::uint32_t>(frame.size),
              FrameStatus::kStored, 0});
      last_stored_time_ = frame.time;
      ++index_.recovered;
    }
  }

  void accept(const FrameRecord& record) {
    index_.records.push_back(record);
    last_time_ = std::max(last_time_, record.time_ns);
  }

  Bytes archive_;
  std::size_t cursor_;
  Nanoseconds last_time_ = 0, last_stored_time_ = -1;
  std::vector<FrameRecord> cut_off_;
  bool keeps_lost_;
  ArchiveIndex& index_;
};

// Marks frames at the very end whose hash differs as torn. After a power loss an unclosed archive
// may end in blocks that were never written, although its size and the journal include them. One
// that was closed and is shorter now has lost its end otherwise: what is left of it was written.
void drop_unwritten_tail(Bytes archive, ArchiveIndex& index) {
  for (auto record = index.records.rbegin(); record != index.records.rend(); ++record) {
    if (record->status != FrameStatus::kStored) continue;
    if (record->xxh3 == 0 ||
        XXH3_64bits(archive.data() + record->offset, record->size) == record->xxh3) {
      return;
    }
    *record = without_frame(*record, FrameStatus::kTorn);
  }
}

/// Marks the frames without a record as unverified, unless an interrupted write explains that.
void mark_unverified(const journal::Contents& contents, bool is_cut, ArchiveIndex& index) {
  const auto is_unlisted = [](const FrameRecord& record) {
    return record.status == FrameStatus::kStored && record.xxh3 == 0;
  };
  const auto first = std::ranges::find_if(index.records, is_unlisted);
  const bool is_at_end = std::all_of(first, index.records.end(), is_unlisted);
  const bool by_a_crash = !index.closed && !is_cut && contents.header && is_at_end &&
                          index.recovered <= journal::kMaxTrustedUnlistedFrames &&
                          index.damaged_records == (contents.has_torn_end ? 1 : 0);
  if (by_a_crash) return;
  for (FrameRecord& record : index.records)
    if (is_unlisted(record)) record.is_unverified = true;
}

}  // namespace

ArchiveIndex index_archive(Bytes archive, std::optional<Bytes> journal,
                           std::string_view archive_name, std::string_view journal_name) {
  ArchiveIndex index;
  const auto preamble = matroska::read_preamble(archive, archive_name);
  index.description = preamble.description;
  index.closed = preamble.closed;
  journal::Contents contents;
  if (journal) contents = journal::decode(*journal, journal_name);
  index.damaged_records = static_cast<int>(contents.damaged);

  if (contents.header && preamble.first_cluster &&
      (contents.header->epoch_utc != index.description.epoch_utc ||
       contents.header->camera_hash != journal::hash_camera_id(index.description.camera_id))) {
    throw Error::bad_input(
        "the journal belongs to another archive than " + std::string(archive_name) +
            ": the camera or epoch differs",
        std::string(journal_name) + " @16",
        "Run `raystage repair` on the take, which recovers damaged headers, or put the archive's "
        "own journal in its place");
  }
  Merger merger(archive, preamble, index);
  for (const FrameRecord& record : contents.records) merger.add(record);
  merger.finish();
  if (!index.closed && !preamble.is_cut) drop_unwritten_tail(archive, index);
  mark_unverified(contents, preamble.is_cut, index);

  index.frames.reserve(index.records.size());
  for (const FrameRecord& record : index.records) {
    if (record.status == FrameStatus::kStored) index.frames.push_back(record);
  }
  return index;
}

}  // namespace raystage::store
