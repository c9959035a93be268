// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <stop_token>
#include <string>
#include <vector>

#include "base/run_status.h"
#include "base/time.h"
#include "schemas/fixity_catalogue.h"

namespace raystage::store {

/// Name of a catalogue in the folder of the takes, and of the file that is locked while it is used.
inline constexpr const char* kCatalogueFile = "raystage-fixity.json";

/// Settings of a check of many takes.
struct CatalogueOptions {
  std::filesystem::path file;   ///< of the catalogue; empty: kCatalogueFile in the folder
  double due_days = 90;         ///< after a check until the next one
  double bytes_per_second = 0;  ///< at most, over all cameras; 0: no limit
  bool only_reports = false;    ///< checks, locks and writes nothing
  /// Removes takes that are not there from the catalogue, unless they may be there: see
  /// check_takes_below().
  bool forgets_missing = false;
  double save_seconds = 5;               ///< between writes of the progress
  Nanoseconds now_utc = 0;               ///< when the run begins, since 1970
  std::function<void(double)> progress;  ///< called with the share of the due bytes done, 0 to 1
  /// Called when the check of a take has ended.
  std::function<void(const schemas::FixityCatalogue::Take&)> on_checked;
  std::stop_token stop;
};

/// What is known of a take after a run.
struct CatalogueEntry {
  schemas::FixityCatalogue::Take take;
  Nanoseconds due_utc = 0;   ///< of the next check; 0: never checked
  bool is_due = false;       ///< after the run
  bool is_new = false;       ///< found for the first time
  bool is_changed = false;   ///< its files changed since the last check
  bool was_checked = false;  ///< in this run
  /// Whether it or a folder that holds it cannot be read: it was not checked, and what is known of
  /// it was kept.
  bool is_unreachable = false;
  bool is_missing() const { return take.missing_since_utc.has_value(); }
  /// Whether it is there, and the latest check found it intact.
  bool is_good() const;
};

struct CatalogueReport {
  std::filesystem::path file;
  std::vector<CatalogueEntry> takes;  ///< by path
  std::vector<std::string>
      problems;             ///< folders that cannot be read; takes that were not forgotten
  std::uint64_t bytes = 0;  ///< of the takes that were checked
  double seconds = 0;       ///< wall time
  RunStatus status = RunStatus::kNotRun;
  /// Whether every take is there and no check found a problem. Takes that were never checked do not
  /// count.
  bool is_good() const;
};

/// Checks the takes below a folder that are due: never checked, changed since then, or checked more
/// than `due_days` ago; those of an interrupted run first, where it was unless that began more
/// than `due_days` ago. Every byte is compared
/// with its recorded hash, and the page cache is left as it was. The catalogue is replaced by a
/// complete one after each take and every `save_seconds`. No take is forgotten while a
/// folder cannot be read or if no take is left, and none that was in a folder that is empty now (a
/// disk that is not mounted). Throws Error (bad input) if the folder or
/// the catalogue cannot be read, and Error (failed) if another run uses the catalogue or it cannot
/// be written.
CatalogueReport check_takes_below(const std::filesystem::path& folder,
                                  const CatalogueOptions& options);

}  // namespace raystage::store
