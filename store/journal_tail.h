// SPDX-License-Identifier: Apache-2.0
// The end of a journal that is being written: what a viewer of a running recording reads.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string_view>
#include <vector>

#include "base/contained_path.h"
#include "store/archive.h"
#include "store/timeline.h"

namespace raystage::store {

/// Reads the records that were appended to a journal since the last read. Cost: those records. Not
/// thread-safe.
class JournalTail {
 public:
  /// The first read begins at most `first_records` before the end.
  JournalTail(ContainedPath journal, std::size_t first_records);

  /// Returns the new records that pass their check and have a time that archives can have, in file
  /// order; none while the journal has no intact header. A record that is written only in part
  /// comes with a later read. Throws Error (bad input) if the header is intact and of a future
  /// version.
  std::vector<FrameRecord> read();

 private:
  ContainedPath journal_;
  std::size_t first_records_;
  std::uint32_t version_ = 0;  ///< 0: no header yet
  std::uint64_t position_ = 0;
};

/// Returns the times of the first and the last record of a journal; nullopt if it has none that
/// pass their check, or none that archives can have. Reads these two records only.
std::optional<TimeRange> journal_time_range(const ContainedPath& journal);

}  // namespace raystage::store
