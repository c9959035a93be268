// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/time.h"

namespace raystage::schemas {

/// Schema "raystage/fixity_catalogue/1": which takes below a folder were checked, and when. Times
/// are ns since 1970 (UTC).
struct FixityCatalogue {
  enum class Result { kIntact, kNotClosed, kDamaged, kUnreadable };

  struct Check {
    Nanoseconds finished_utc = 0;
    std::string state;  ///< of the take's files when the check began: names, sizes, times
    Result result = Result::kIntact;
    std::int64_t problem_count = 0;
    std::vector<std::string> problems;  ///< the first ones
    std::int64_t bytes = 0;             ///< of archives and journals
    double seconds = 0;                 ///< wall time of its last part
  };
  struct Camera {
    std::string id;
    std::int64_t frames = 0;  ///< from the first one, intact
    bool is_complete = false;
  };
  /// Of a check that has not ended.
  struct Progress {
    Nanoseconds started_utc = 0;
    std::string state;  ///< see Check
    std::vector<Camera> cameras;
  };
  struct Take {
    std::string path;  ///< relative to the folder of the catalogue
    std::string name;  ///< may be empty
    Nanoseconds first_seen_utc = 0;
    std::optional<Nanoseconds> missing_since_utc, last_intact_utc;
    std::optional<Check> last_check;
    std::optional<Progress> progress;
  };
  std::vector<Take> takes;
};

/// Returns "intact", "not_closed", "damaged" or "unreadable".
std::string_view name_of(FixityCatalogue::Result result);

/// Parses and formats the document in memory; errors use `name` as the file name. Throws Error (bad
/// input) if it is not valid.
FixityCatalogue parse_fixity_catalogue(std::string_view text, std::string_view name);
std::string format_fixity_catalogue(const FixityCatalogue& catalogue);

/// Throws Error as read_file() and write_file_atomically(), and as parse_fixity_catalogue().
FixityCatalogue read_fixity_catalogue(const std::filesystem::path& file);
void write_fixity_catalogue(const FixityCatalogue& catalogue, const std::filesystem::path& file);

}  // namespace raystage::schemas
