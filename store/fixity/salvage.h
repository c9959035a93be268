// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "store/fixity/verify_archive.h"

namespace raystage::store {

/// The parts of a damaged archive and its journal that can be saved, and the losses.
struct SalvageResult {
  /// The records of the repaired pair, in order. Stored frames are intact as far as this can be
  /// checked: `offset` is that of their bytes in the damaged archive, and `xxh3` is set.
  std::vector<FrameRecord> records;

  /// Losses and doubts, one sentence each, with a time or position.
  struct Loss {
    Nanoseconds time_ns = kUnknownTime;  ///< of the frame, if a frame is concerned
    std::string what;
  };
  std::vector<Loss> losses;

  std::int64_t frames = 0;             ///< stored frames that are saved
  std::int64_t corrupt_frames = 0;     ///< their hash differs; now records of status torn
  std::int64_t truncated_frames = 0;   ///< beyond the archive's end; now records of status torn
  std::int64_t reindexed_frames = 0;   ///< found in the archive; their record is lost
  std::int64_t unverified_frames = 0;  ///< of those, without a surviving hash
  std::int64_t corrected_records = 0;  ///< one flipped bit was corrected
  std::int64_t lost_records = 0;       ///< unreadable, or contradicting the archive
  std::uint64_t lost_bytes = 0;        ///< of the archive: no frame and no known structure

  /// XXH3 of the frames that are lost although their records are not, by time.
  std::map<Nanoseconds, std::uint64_t> lost_hashes;
  std::set<Nanoseconds> unverified_times;  ///< of the unverified_frames
  /// Of the lost frames whose hash was that of the bytes found by an earlier repair.
  std::set<Nanoseconds> lost_unverified_times;
};

/// Returns what can be saved of a pair; accepts any bytes. Throws Error (bad input) if the journal
/// is of a future version, or intact files belong to another camera or take.
SalvageResult salvage_archive(const ArchivePair& pair);

}  // namespace raystage::store
