// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "store/archive.h"

namespace raystage {

/// The table of an archive: its journal held against the Matroska file. On bytes in memory, so that
/// any bytes can be tried.
struct ArchiveIndex {
  ArchiveWriter::Description description;
  std::vector<FrameRecord> records;  ///< see ArchiveReader; every stored one lies in the archive
  std::vector<FrameRecord> frames;   ///< the stored ones
  bool closed = false;
  int recovered = 0;        ///< frames found in the archive that the journal does not list
  int damaged_records = 0;  ///< of the journal: torn, rotten, or at odds with the archive
};

/// The journal is believed where its records make sense; what lies in the archive between and
/// behind them is scanned. A record whose frame is cut off by the archive's end becomes kTorn.
/// `journal` is nullopt where there is none. Throws Error (bad input): no Matroska, another time
/// scale, a future journal version, the journal of another archive.
ArchiveIndex index_archive(std::span<const std::byte> archive,
                           std::optional<std::span<const std::byte>> journal,
                           std::string_view archive_name, std::string_view journal_name);

}  // namespace raystage
