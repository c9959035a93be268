// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace raystage::planning {

/// A setting of a method that `raystage bench` measured with all cameras.
struct MeasuredSetting {
  std::string label, method;
  double psnr_db = 0;
  double seconds_per_frame = 0;
  std::optional<double> peak_memory_bytes;
  bool is_on_front = false;  ///< none is as good in less time
};

/// Reads the settings of a bench's trade.json (raystage/trade/1); those that failed are left out.
/// Throws Error (bad input) for another file.
std::vector<MeasuredSetting> read_measured_settings(const std::filesystem::path& file);

/// Returns the fastest setting that is at most 0.5 dB worse than the best; null if there is none.
const MeasuredSetting* suggested_setting(const std::vector<MeasuredSetting>& settings);

/// Returns the best setting of a method; null if it was not measured.
const MeasuredSetting* setting_of_method(const std::vector<MeasuredSetting>& settings,
                                         std::string_view method);

}  // namespace raystage::planning
