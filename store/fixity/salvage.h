// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "store/fixity/verify_archive.h"

namespace raystage {

/// What can be saved of a damaged archive and its journal, and what cannot.
struct Salvage {
  /// The records of the repaired pair, in order. Stored ones are whole, as far as anything can
  /// tell: their offset is where their bytes lie in the damaged archive, their hash is set.
  std::vector<FrameRecord> records;

  /// What is lost or in doubt, one sentence each, with time or place.
  struct Loss {
    Nanoseconds time_ns = kUnknownTime;  ///< of the frame, where it is one
    std::string what;
  };
  std::vector<Loss> losses;

  std::int64_t frames = 0;           ///< stored frames that are saved
  std::int64_t rotten_frames = 0;    ///< their hash fails: now records of status torn
  std::int64_t cut_off_frames = 0;   ///< beyond the archive's end: now records of status torn
  std::int64_t relisted_frames = 0;  ///< taken from the archive, as their record is lost
  std::int64_t unproven_frames = 0;  ///< of those, the ones without any surviving hash
  std::int64_t mended_records = 0;   ///< one flipped bit, flipped back
  std::int64_t lost_records = 0;     ///< could not be read, or contradicted the archive
  std::uint64_t lost_bytes = 0;      ///< of the archive: part of no frame, and not what we wrote
};

/// Reads any bytes. Throws Error (bad input) for a journal of a future version, and where the files
/// are whole but another camera's or take's.
Salvage salvage(const ArchivePair& pair);

}  // namespace raystage
