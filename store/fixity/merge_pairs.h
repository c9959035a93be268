// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "store/fixity/salvage.h"

namespace raystage::store {

/// An archive and its journal, and what salvage_archive() made of them.
struct ExaminedPair {
  const ArchivePair& pair;
  bool is_intact = false;  ///< by verify_archive()
  SalvageResult saved;
};

/// What shows that the bytes of a frame are the recorded ones; each is better than those before it.
enum class FrameTrust {
  kNone,      ///< nothing: no journal has a record
  kRepaired,  ///< a record made after the first was lost: they have not changed since then
  kRecorded   ///< the record of the recording
};

/// A camera's records from two copies of its archive.
struct MergedPair {
  struct Entry {
    FrameRecord record;
    std::span<const std::byte> jpeg;  ///< of a stored frame, in the archive that has it
    FrameTrust trust = FrameTrust::kRecorded;
    bool from_copy = false;
  };
  std::vector<Entry> entries;  ///< in order
  std::int64_t frames = 0;     ///< stored
  std::int64_t frames_from_copy = 0;
  /// What neither of them has, and what cannot be verified.
  std::vector<SalvageResult::Loss> losses;
  /// Parts of the own pair are damaged, and nothing says what they were: keep the original.
  bool has_unidentified_damage = false;
  bool equals_own = false;   ///< the copy adds nothing to the pair, which is intact
  bool equals_copy = false;  ///< the copy is intact and has every record of the result
};

/// Merges two copies of a camera's archive, of which each may be damaged or end early. A frame is
/// taken from the copy only if its bytes have the XXH3 that either journal states. Nothing that
/// `own` has is dropped, except frames of which the copy has more trusted ones. Throws Error (bad
/// input) if both have a frame of one time as recorded, and the two differ: these are two takes.
MergedPair merge_pairs(const ExaminedPair& own, const ExaminedPair& copy);

/// Writes the result as a new pair of closed files; that of the copy byte for byte if it equals the
/// copy. Throws Error (failed) if the disk fails.
void write_merged_pair(const MergedPair& merged, const ArchivePair& copy,
                       const ArchiveWriter::Description& description,
                       const std::filesystem::path& archive, const std::filesystem::path& journal);

}  // namespace raystage::store
