// SPDX-License-Identifier: Apache-2.0
#include "calibrate/color_match.h"

#include <fmt/format.h>

#include "schemas/document.h"

namespace raystage {
namespace {

std::string spread_line(const char* when, const ColorSpread& spread) {
  return fmt::format(
      "{:<10} cameras' means differ by {:.2f} % in red, {:.2f} in green, {:.2f} in blue (one "
      "sigma); CIEDE2000 {:.2f} in the mean, {:.2f} at most\n",
      when, 100 * spread.deviation[0], 100 * spread.deviation[1], 100 * spread.deviation[2],
      spread.mean_difference, spread.most_difference);
}

nlohmann::ordered_json spread_json(const ColorSpread& spread) {
  return {{"deviation", spread.deviation},
          {"mean_ciede2000", spread.mean_difference},
          {"most_ciede2000", spread.most_difference}};
}

}  // namespace

std::string color_text(const ColorMatch& match, const std::string& reference) {
  std::string text = fmt::format("Reference  {}\n", reference);
  text += spread_line("Before", match.before) + spread_line("After", match.after);
  for (const std::string& finding : match.findings) text += finding + "\n";
  for (const std::string& warning : match.warnings) text += "Weak       " + warning + "\n";
  for (const std::string& reason : match.reasons) text += "Not sure   " + reason + "\n";
  return text;
}

std::string color_json(const ColorMatch& match, const std::string& reference,
                       const std::vector<std::string>& cameras) {
  nlohmann::ordered_json json;
  json["is_vouched_for"] = match.reasons.empty();
  json["reasons"] = match.reasons;
  json["warnings"] = match.warnings;
  json["findings"] = match.findings;
  json["reference"] = reference;
  json["before"] = spread_json(match.before);
  json["after"] = spread_json(match.after);
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    json["cameras"].push_back({{"id", cameras[i]}, {"photometric", json_from(match.responses[i])}});
  }
  return json.dump(1) + "\n";
}

}  // namespace raystage
