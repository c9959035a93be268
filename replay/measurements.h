// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace raystage::replay {

/// What `raystage bench` measured of a method with its default options.
struct MethodMeasurement {
  std::string method;
  double psnr_db = 0;
  double seconds_per_frame = 0;
};

/// Returns the measurements of a report (docs/formats/trade.md), if it is of the take with this
/// name; none if it is not a report. Accepts any bytes.
std::vector<MethodMeasurement> parse_measurements(std::string_view report, std::string_view take);

/// Returns those of the reports FOLDER/trade.json and FOLDER/*/trade.json; the latest file wins.
/// Links are not followed.
std::vector<MethodMeasurement> find_measurements(const std::filesystem::path& folder,
                                                 std::string_view take);

}  // namespace raystage::replay
