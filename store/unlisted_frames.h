// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <vector>

#include "store/archive.h"

namespace raystage::store {

/// An archive and its journal in one of two copies of a take.
struct ArchiveFiles {
  std::filesystem::path archive, journal;
};

/// The records of one copy of an archive, for comparison with another copy.
struct CopyRecords {
  /// As ArchiveReader returns them, but with the XXH3 also of frames that the journal lacks.
  std::vector<FrameRecord> records;
  std::size_t listed = 0;    ///< records before the frames at the end that the journal lacks
  bool has_journal = false;  ///< with an intact header
};
/// Throws Error as ArchiveReader.
CopyRecords read_copy_records(const ArchiveFiles& files);

/// Returns whether two copies have the same record. A frame whose record was lost in a crash has no
/// arrival and sequence number.
bool is_same_record(const FrameRecord& a, const FrameRecord& b);

/// Returns the records of `own` with those that `other` has of the frames at the end of `own` that
/// its journal lacks, and of missing frames before these. No frame of `own` is left out. Returns
/// nullopt if one of the two is not the beginning of the other then, or `own` has
/// no journal. Reads no files.
std::optional<std::vector<FrameRecord>> complete_records(const CopyRecords& own,
                                                         const CopyRecords& other);

/// Writes complete_records() to the journal if frames at the end of the archive have no record: a
/// crash came between the two. The archive is unchanged. Throws Error as ArchiveReader, Error (bad
/// input) if complete_records() returns nothing, and Error (failed) if the archive is open for
/// writing elsewhere or the disk fails.
void complete_journal(const ArchiveFiles& own, const ArchiveFiles& other);

}  // namespace raystage::store
