// SPDX-License-Identifier: Apache-2.0
// raystage info of a rig without a take.
#include "cli/info_rig.h"

#include <fmt/format.h>

#include <set>
#include <string>
#include <utility>

#include "cli/printing.h"
#include "cli/shutter_text.h"
#include "rig/rig.h"
#include "schemas/json_text.h"
#include "schemas/rig_document.h"
#include "store/take_summary.h"

namespace raystage::cli {
namespace {

using OrderedJson = nlohmann::ordered_json;

std::string sizes_of(const rig::Rig& rig) {
  std::set<std::pair<int, int>> sizes;
  for (const auto& camera : rig.cameras) {
    sizes.emplace(camera.model.width(), camera.model.height());
  }
  std::string text;
  for (const auto& [width, height] : sizes) {
    text += fmt::format("{}{} x {}", text.empty() ? "" : ", ", width, height);
  }
  return text + " pixels";
}

OrderedJson json_of_rig(const schemas::RigDocument& document, const rig::Rig& rig) {
  OrderedJson cameras = OrderedJson::array();
  for (const auto& camera : rig.cameras) {
    cameras.push_back(
        {{"id", camera.id}, {"width", camera.model.width()}, {"height", camera.model.height()}});
  }
  return {{"name", document.name},
          {"calibrated", schemas::is_calibrated(document)},
          {"median_baseline_m", store::median_baseline(rig)},
          {"lenses", lenses_as_json(rig::summarise_lenses(rig))},
          {"shutter", shutters_as_json(store::summarise_shutters(rig))},
          {"cameras", std::move(cameras)}};
}

}  // namespace

nlohmann::ordered_json lenses_as_json(const std::vector<rig::LensSummary>& lenses) {
  OrderedJson list = OrderedJson::array();
  for (const rig::LensSummary& lens : lenses) {
    list.push_back({{"projection", rig::projection_title(lens.projection)},
                    {"cameras", lens.cameras},
                    {"min_fov_deg", lens.min_fov_deg},
                    {"max_fov_deg", lens.max_fov_deg}});
  }
  return list;
}

nlohmann::ordered_json shutters_as_json(const store::ShutterSummary& shutters) {
  if (shutters.is_global()) return {{"kind", "global"}, {"rolling_cameras", 0}};
  return {{"kind", "rolling"},
          {"rolling_cameras", shutters.rolling},
          {"line_time_us", {shutters.min_line_time_us, shutters.max_line_time_us}},
          {"read_out_ms", {shutters.min_read_out_ms, shutters.max_read_out_ms}}};
}

ExitCode info_of_rig(const std::filesystem::path& file, bool json) {
  const schemas::RigDocument document = schemas::read_rig(file);
  const rig::Rig rig = rig::rig_from_document(document);
  if (json) {
    print(schemas::dump_json(json_of_rig(document, rig)) + "\n");
    return ExitCode::kSuccess;
  }
  const auto line = [](std::string_view name, const std::string& text) {
    print("{:<12}{}\n", name, text);
  };
  line("Rig", fmt::format("{} ({})", document.name, file.string()));
  line("Cameras", fmt::format("{}, {}, {:.4g} m apart", rig.cameras.size(), sizes_of(rig),
                              store::median_baseline(rig)));
  line("Lenses", rig::format_lenses(rig::summarise_lenses(rig)));
  line("Shutter", shutter_text(store::summarise_shutters(rig)));
  return ExitCode::kSuccess;
}

}  // namespace raystage::cli
