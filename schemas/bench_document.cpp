// SPDX-License-Identifier: Apache-2.0
#include "schemas/bench_document.h"

#include "base/atomic_file.h"
#include "schemas/document.h"

namespace raystage {

BenchDocument parse_bench(std::string_view text, std::string_view name) {
  const nlohmann::json json = parse_document("bench", text, name);
  const JsonNode document{json, name, ""};
  BenchDocument bench;
  std::set<std::string, std::less<>> seen;
  const JsonNode settings = document.at("settings");
  for (std::size_t i = 0; i < settings.size(); ++i) {
    const JsonNode object = settings.at(i);
    BenchDocument::Setting setting;
    setting.label = object.at("label").get<std::string>();
    if (!seen.insert(setting.label).second) {
      throw object.at("label").input_error("found " +
                                               describe_json_value(object.at("label").value) +
                                               ", which is used already, allowed: a unique label",
                                           "Give every setting a different label");
    }
    setting.method = object.at("method").get<std::string>();
    if (object.has("options")) setting.options = options_from(object.at("options"));
    if (object.has("focal_depth_m")) setting.focal_depth = object.at("focal_depth_m").get<double>();
    bench.settings.push_back(std::move(setting));
  }
  return bench;
}

std::string format_bench(const BenchDocument& bench) {
  nlohmann::ordered_json json = make_document("bench");
  auto& list = json["settings"] = nlohmann::ordered_json::array();
  for (const BenchDocument::Setting& setting : bench.settings) {
    nlohmann::ordered_json object{{"label", setting.label},
                                  {"method", setting.method},
                                  {"options", json_from(setting.options)}};
    if (setting.focal_depth) object["focal_depth_m"] = *setting.focal_depth;
    list.push_back(std::move(object));
  }
  return format_json(json);
}

BenchDocument read_bench(const std::filesystem::path& file) {
  return parse_bench(read_file(file), file.string());
}

}  // namespace raystage
