// SPDX-License-Identifier: Apache-2.0
#include "planning/measured_settings.h"

#include <algorithm>
#include <limits>

#include "base/atomic_file.h"
#include "base/error.h"
#include "schemas/json_text.h"

namespace raystage::planning {
namespace {

using Json = nlohmann::json;

/// Returns a number of a row; nullopt if it is not measured.
std::optional<double> number_of(const Json& row, const char* name) {
  const auto found = row.find(name);
  if (found == row.end() || !found->is_number()) return std::nullopt;
  return found->get<double>();
}

std::string text_of(const Json& row, const char* name) {
  const auto found = row.find(name);
  return found != row.end() && found->is_string() ? found->get<std::string>() : "";
}

std::optional<MeasuredSetting> setting_from(const Json& row) {
  if (!row.is_object()) return std::nullopt;
  const auto psnr = number_of(row, "psnr_db"), seconds = number_of(row, "seconds_per_frame");
  if (!psnr || !seconds || number_of(row, "camera_step").value_or(1) != 1) return std::nullopt;
  MeasuredSetting setting{text_of(row, "label"),
                          text_of(row, "method"),
                          *psnr,
                          *seconds,
                          number_of(row, "peak_memory_bytes"),
                          false};
  const auto front = row.find("on_psnr_front");
  setting.is_on_front = front != row.end() && front->is_boolean() && front->get<bool>();
  return setting;
}

}  // namespace

std::vector<MeasuredSetting> read_measured_settings(const std::filesystem::path& file) {
  const Json document = schemas::parse_json(read_file(file), file.string());
  const auto refuse = [&] {
    return Error::bad_input("the file is no result of a bench", file.string(),
                            "Give the trade.json that `raystage bench` wrote");
  };
  if (!document.is_object() || text_of(document, "schema") != "raystage/trade/1") throw refuse();
  const auto rows = document.find("rows");
  if (rows == document.end() || !rows->is_array()) throw refuse();
  std::vector<MeasuredSetting> settings;
  for (const Json& row : *rows) {
    if (auto setting = setting_from(row)) settings.push_back(std::move(*setting));
  }
  return settings;
}

const MeasuredSetting* suggested_setting(const std::vector<MeasuredSetting>& settings) {
  constexpr double kAsGood = 0.5;  // dB
  double best = -std::numeric_limits<double>::infinity();
  for (const MeasuredSetting& setting : settings) {
    if (setting.is_on_front) best = std::max(best, setting.psnr_db);
  }
  const MeasuredSetting* fastest = nullptr;
  for (const MeasuredSetting& setting : settings) {
    if (!setting.is_on_front || setting.psnr_db < best - kAsGood) continue;
    if (fastest == nullptr || setting.seconds_per_frame < fastest->seconds_per_frame) {
      fastest = &setting;
    }
  }
  return fastest;
}

const MeasuredSetting* setting_of_method(const std::vector<MeasuredSetting>& settings,
                                         std::string_view method) {
  const MeasuredSetting* best = nullptr;
  for (const MeasuredSetting& setting : settings) {
    if (setting.method == method && (best == nullptr || setting.psnr_db > best->psnr_db)) {
      best = &setting;
    }
  }
  return best;
}

}  // namespace raystage::planning
