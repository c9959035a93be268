// SPDX-License-Identifier: Apache-2.0
// Merges the salvaged records of two copies of an archive. The records of the more trusted copy
// keep their order; those of the other are matched by time, arrival and sequence number, frames
// whose record is lost by time alone, and the rest is inserted by time. Cost: O(n log n) for n
// records; no bytes are hashed, because salvage_archive() did.
#include "store/fixity/merge_pairs.h"

#include <algorithm>
#include <map>
#include <optional>
#include <string>
#include <tuple>
#include <utility>

#include "base/error.h"
#include "base/posix_file.h"

namespace raystage::store {
namespace {

using Entry = MergedPair::Entry;
using Key = std::tuple<Nanoseconds, Nanoseconds, std::uint64_t>;

Key key_of(const FrameRecord& record) {
  return {record.time_ns, record.arrival_ns, record.sequence};
}

bool is_stored(const FrameRecord& record) { return record.status == FrameStatus::kStored; }

/// Returns the XXH3 of a frame that was stored but is lost, or nullopt for all other records.
std::optional<std::uint64_t> lost_hash(const SalvageResult& saved, const FrameRecord& record) {
  const auto found = saved.lost_hashes.find(record.time_ns);
  if (record.status != FrameStatus::kTorn || found == saved.lost_hashes.end()) return {};
  return found->second;
}

/// Returns whether neither file of a pair is longer than that of the other.
bool goes_no_further(const ArchivePair& pair, const ArchivePair& other) {
  const std::size_t journal = pair.journal ? pair.journal->size() : 0;
  const std::size_t other_journal = other.journal ? other.journal->size() : 0;
  return pair.archive.size() <= other.archive.size() && journal <= other_journal;
}

void take_origin(FrameRecord& record, const FrameRecord& other) {
  if (record.arrival_ns != kUnknownTime) return;
  record.arrival_ns = other.arrival_ns;
  record.sequence = other.sequence;
}

/// Merges the records of `other_` into those of `base_`.
class Merger {
 public:
  Merger(const ExaminedPair& own, const ExaminedPair& copy)
      : own_(own),
        copy_(copy),
        base_(copy.is_intact ? copy : own),
        other_(copy.is_intact ? own : copy) {}

  MergedPair run() {
    for (const FrameRecord& record : base_.saved.records) {
      by_key_.emplace(key_of(record), result_.entries.size());
      if (is_stored(record) || lost_hash(base_.saved, record)) {
        pictures_.emplace(record.time_ns, result_.entries.size());
      }
      result_.entries.push_back(entry_of(base_, record));
    }
    for (const FrameRecord& record : other_.saved.records) {
      if (Entry* const match = find(record)) {
        combine(*match, record);
      } else {
        add(record);
      }
    }
    insert_added();
    leave_out_unverified();
    for (Entry& entry : result_.entries) {
      entry.record.is_unverified = is_stored(entry.record) && entry.trust != FrameTrust::kRecorded;
    }
    count();
    return std::move(result_);
  }

 private:
  Entry entry_of(const ExaminedPair& side, const FrameRecord& record) const {
    Entry entry{record, {}, FrameTrust::kRecorded, &side == &copy_};
    if (!is_stored(record)) return entry;
    entry.jpeg = side.pair.archive.subspan(static_cast<std::size_t>(record.offset), record.size);
    entry.trust = side.saved.unverified_times.contains(record.time_ns) ? FrameTrust::kNone
                  : record.is_unverified                               ? FrameTrust::kRepaired
                                                                       : FrameTrust::kRecorded;
    return entry;
  }

  Entry* find(const FrameRecord& record) {
    if (const auto same = by_key_.find(key_of(record)); same != by_key_.end()) {
      return &result_.entries[same->second];
    }
    if (!is_stored(record) && !lost_hash(other_.saved, record)) return nullptr;
    const auto same = pictures_.find(record.time_ns);
    return same == pictures_.end() ? nullptr : &result_.entries[same->second];
  }

  void combine(Entry& entry, const FrameRecord& record) {
    Entry second = entry_of(other_, record);
    if (is_stored(entry.record) && is_stored(record)) {
      combine_frames(entry, second);
    } else if (is_stored(record)) {
      if (const auto expected = lost_hash(base_.saved, entry.record)) {
        const FrameTrust lost = trust_of_lost(base_, entry.record);
        if (*expected == record.xxh3) {
          second.trust = std::max(second.trust, lost);
        } else if (lost > second.trust) {
          return;  // other bytes than the recorded ones
        }
      }
      if (second.from_copy && second.trust == FrameTrust::kNone) return;
      take_origin(second.record, entry.record);
      entry = second;
    } else if (const auto expected = lost_hash(other_.saved, record)) {
      const FrameTrust lost = trust_of_lost(other_, record);
      if (*expected == entry.record.xxh3) {
        entry.trust = std::max(entry.trust, lost);
      } else if (entry.from_copy && lost > entry.trust) {
        entry = second;  // lost: other bytes than the recorded ones are no replacement
        return;
      }
      take_origin(entry.record, record);
    }
  }

  /// Returns what the XXH3 that a side has of a lost frame shows.
  static FrameTrust trust_of_lost(const ExaminedPair& side, const FrameRecord& record) {
    return side.saved.lost_unverified_times.contains(record.time_ns) ? FrameTrust::kRepaired
                                                                     : FrameTrust::kRecorded;
  }

  void combine_frames(Entry& entry, Entry second) const {
    const bool same =
        entry.record.size == second.record.size && entry.record.xxh3 == second.record.xxh3;
    if (same) {
      entry.trust = std::max(entry.trust, second.trust);
      take_origin(entry.record, second.record);
      if (entry.from_copy) {  // own bytes, which are the same
        entry.jpeg = second.jpeg;
        entry.from_copy = second.from_copy;
      }
      return;
    }
    if (entry.trust == FrameTrust::kRecorded && second.trust == FrameTrust::kRecorded) {
      throw Error::bad_input("the copy has another frame at " +
                                 std::to_string(entry.record.time_ns) +
                                 " ns, and both have their XXH3: it is the copy of another take",
                             copy_.pair.archive_name, "Use a copy of this take");
    }
    const bool take_second =
        second.trust > entry.trust || (second.trust == entry.trust && entry.from_copy);
    if (!take_second) return;
    take_origin(second.record, entry.record);
    entry = second;
  }

  void add(const FrameRecord& record) { added_.push_back(entry_of(other_, record)); }

  /// Inserts frames before and records of missing frames after those of the same time: a frame that
  /// came late has the time of the one before.
  void insert_added() {
    std::vector<Entry> all;
    all.reserve(result_.entries.size() + added_.size());
    auto added = added_.begin();
    const auto comes_before = [](const Entry& a, const Entry& b) {
      if (a.record.time_ns != b.record.time_ns) return a.record.time_ns < b.record.time_ns;
      return is_stored(a.record);
    };
    for (const Entry& entry : result_.entries) {
      while (added != added_.end() && comes_before(*added, entry)) all.push_back(*added++);
      all.push_back(entry);
    }
    all.insert(all.end(), added, added_.end());
    result_.entries = std::move(all);
  }

  /// A frame of the copy of which no journal has the XXH3 is not taken.
  void leave_out_unverified() {
    std::erase_if(result_.entries, [&](const Entry& entry) {
      const bool leave_out = entry.from_copy && entry.trust == FrameTrust::kNone;
      if (leave_out) {
        result_.losses.push_back({entry.record.time_ns,
                                  "a frame of the copy has no record, so that it cannot be "
                                  "verified: it was not taken"});
      }
      return leave_out;
    });
  }

  void count() {
    std::map<Nanoseconds, bool> stored;  // and whether it is verified, by time
    bool like_own = own_.is_intact, like_copy = copy_.is_intact;
    const auto& own = own_.saved.records;
    const auto& copy = copy_.saved.records;
    const std::size_t size = result_.entries.size();
    like_own = like_own && own.size() == size;
    like_copy = like_copy && copy.size() == size;
    for (std::size_t i = 0; i < size; ++i) {
      const Entry& entry = result_.entries[i];
      const auto is_like = [&](const FrameRecord& record) {
        return key_of(record) == key_of(entry.record) && record.status == entry.record.status &&
               record.size == entry.record.size && record.xxh3 == entry.record.xxh3 &&
               record.is_unverified == entry.record.is_unverified;
      };
      like_own = like_own && is_like(own[i]);
      like_copy = like_copy && is_like(copy[i]);
      if (!is_stored(entry.record)) continue;
      ++result_.frames;
      stored.emplace(entry.record.time_ns, entry.trust == FrameTrust::kRecorded);
    }
    result_.equals_own = like_own;
    result_.equals_copy = like_copy;
    std::map<Nanoseconds, std::uint64_t> had;  // hashes of frames that were there before
    for (const FrameRecord& record : own) {
      if (is_stored(record)) had.emplace(record.time_ns, record.xxh3);
    }
    for (const Entry& entry : result_.entries) {
      if (!is_stored(entry.record)) continue;
      const auto before = had.find(entry.record.time_ns);
      const bool is_new = before == had.end() || before->second != entry.record.xxh3;
      result_.frames_from_copy += is_new ? 1 : 0;
    }
    // What is at most as long as an intact copy of the same contents had nothing in addition.
    const bool may_drop_unknown =
        like_copy && (own_.is_intact || goes_no_further(own_.pair, copy_.pair));
    bool some_unknown = false;
    for (const SalvageResult::Loss& loss : own_.saved.losses) {
      const bool unknown = loss.time_ns == kUnknownTime;
      const auto now = stored.find(loss.time_ns);
      const bool is_healed = !unknown && now != stored.end() && now->second;
      if (is_healed) continue;
      if (unknown && !own_.is_intact) result_.has_unidentified_damage = true;
      if (unknown && may_drop_unknown) continue;
      some_unknown = some_unknown || unknown;
      result_.losses.push_back(loss);
    }
    if (!some_unknown || like_copy) return;
    for (const SalvageResult::Loss& loss : copy_.saved.losses) {
      if (loss.time_ns == kUnknownTime) {
        result_.losses.push_back({loss.time_ns, "in the copy: " + loss.what});
      }
    }
  }

  const ExaminedPair &own_, &copy_, &base_, &other_;
  std::multimap<Key, std::size_t> by_key_;
  std::map<Nanoseconds, std::size_t> pictures_;  // stored or lost, by time
  std::vector<Entry> added_;                     // of other_, without counterpart, by time
  MergedPair result_;
};

void write_bytes(const std::filesystem::path& path, std::span<const std::byte> bytes) {
  OutputFile file(path);
  if (file.write_at(0, bytes)) return;
  throw Error::from_errno("the file cannot be written", path.string(), "Free space on the disk");
}

}  // namespace

MergedPair merge_pairs(const ExaminedPair& own, const ExaminedPair& copy) {
  return Merger(own, copy).run();
}

void write_merged_pair(const MergedPair& merged, const ArchivePair& copy,
                       const ArchiveWriter::Description& description,
                       const std::filesystem::path& archive, const std::filesystem::path& journal) {
  if (merged.equals_copy && copy.journal) {
    write_bytes(archive, copy.archive);
    write_bytes(journal, *copy.journal);
    return;
  }
  ArchiveWriter out(archive, journal, description);
  for (const Entry& entry : merged.entries) out.append_again(entry.record, entry.jpeg);
  out.close();
}

}  // namespace raystage::store
