// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "store/archive.h"

namespace raystage::store {

/// The index of an archive: its journal, checked against the Matroska file. Works on bytes in
/// memory, so that fuzz tests can pass any bytes.
struct ArchiveIndex {
  ArchiveWriter::Description description;
  /// See ArchiveReader; the archive has all stored ones. Frames without a record have XXH3 0. They
  /// are unverified unless an interrupted write explains that: at most kMaxTrustedUnlistedFrames at
  /// the end of an archive that was not closed, with nothing else missing from its journal.
  std::vector<FrameRecord> records;
  std::vector<FrameRecord> frames;  ///< the stored ones
  /// A frame that was lost with the end of the archive after it had been closed.
  struct LostFrame {
    std::size_t record = 0;  ///< index into `records`, where it is kTorn
    FrameRecord listed;      ///< as the journal lists it
  };
  /// By increasing times; none has the time of a stored frame. Frames that an interrupted recording
  /// did not write are not among them.
  std::vector<LostFrame> lost;
  bool closed = false;
  int recovered = 0;        ///< frames found in the archive that the journal does not list
  int damaged_records = 0;  ///< of the journal: torn, corrupt, or contradicting the archive
};

/// Returns the index of an archive. Uses the journal's records where they are consistent, and scans
/// the archive between and after them. A record whose frame the archive's end truncates becomes
/// kTorn. `journal`: nullopt if there is none. Throws Error (bad input) if `archive` is not
/// Matroska or has another time scale, or the journal has a future version or belongs to another
/// archive.
ArchiveIndex index_archive(std::span<const std::byte> archive,
                           std::optional<std::span<const std::byte>> journal,
                           std::string_view archive_name, std::string_view journal_name);

}  // namespace raystage::store
