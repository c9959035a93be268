// SPDX-License-Identifier: Apache-2.0
#include "replay/measurements.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <system_error>
#include <utility>

#include "base/atomic_file.h"
#include "base/error.h"

namespace raystage::replay {
namespace {

namespace fs = std::filesystem;
constexpr std::uintmax_t kMaxReportBytes = 8'000'000;
constexpr int kMaxFolders = 1000;

/// Returns a member if it is a finite number.
double number_of(const nlohmann::json& object, const char* name) {
  const auto found = object.find(name);
  if (found == object.end() || !found->is_number()) return std::nan("");
  return found->get<double>();
}

std::string text_of(const nlohmann::json& object, const char* name) {
  const auto found = object.find(name);
  return found != object.end() && found->is_string() ? found->get<std::string>() : std::string();
}

bool is_report(const fs::path& file) {
  std::error_code error;
  return !fs::is_symlink(file, error) && fs::is_regular_file(file, error) &&
         fs::file_size(file, error) <= kMaxReportBytes && !error;
}

}  // namespace

std::vector<MethodMeasurement> parse_measurements(std::string_view report, std::string_view take) {
  std::vector<MethodMeasurement> measurements;
  const nlohmann::json json = nlohmann::json::parse(report, nullptr, false);
  if (!json.is_object() || text_of(json, "take") != take) return measurements;
  const auto rows = json.find("rows");
  if (rows == json.end() || !rows->is_array()) return measurements;
  for (const nlohmann::json& row : *rows) {
    // A row with default options has the name of its method.
    if (!row.is_object() || text_of(row, "label") != text_of(row, "method")) continue;
    MethodMeasurement measured{text_of(row, "method"), number_of(row, "psnr_db"),
                               number_of(row, "seconds_per_frame")};
    if (!std::isfinite(measured.psnr_db) || !std::isfinite(measured.seconds_per_frame)) continue;
    std::erase_if(measurements, [&](const auto& other) { return other.method == measured.method; });
    measurements.push_back(std::move(measured));
  }
  return measurements;
}

std::vector<MethodMeasurement> find_measurements(const fs::path& folder, std::string_view take) {
  std::vector<std::pair<fs::file_time_type, fs::path>> reports;
  const auto add = [&](const fs::path& file) {
    std::error_code error;
    if (is_report(file)) reports.emplace_back(fs::last_write_time(file, error), file);
  };
  add(folder / "trade.json");
  std::error_code error;
  int folders = 0;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    if (++folders > kMaxFolders) break;
    std::error_code of_entry;
    if (entry->is_symlink(of_entry) || !entry->is_directory(of_entry)) continue;
    add(entry->path() / "trade.json");
  }
  std::ranges::sort(reports, std::greater());
  for (const auto& [time, file] : reports) {
    try {
      auto measurements = parse_measurements(read_file(file), take);
      if (!measurements.empty()) return measurements;
    } catch (const Error&) {
      continue;  // it was removed, or cannot be read: there are no measurements
    }
  }
  return {};
}

}  // namespace raystage::replay
