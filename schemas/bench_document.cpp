// SPDX-License-Identifier: Apache-2.0
#include "schemas/bench_document.h"

#include <algorithm>

#include "schemas/fields.h"

namespace raystage::schemas {
namespace {

using Setting = BenchDocument::Setting;

void check_label(const JsonNode& object, const std::vector<Setting>& settings) {
  const auto uses = std::ranges::count(settings, settings.back().label, &Setting::label);
  if (uses == 1) return;
  const JsonNode label = object.at("label");
  throw label.input_error("found " + describe_json_value(label.value) +
                              ", which is used already, allowed: a unique label",
                          "Give each setting a different label");
}

constexpr Fields kSetting(required("label", &Setting::label), required("method", &Setting::method),
                          defaulted("options", &Setting::options, kOptionValues),
                          optional("focal_depth_m", &Setting::focal_depth));
constexpr Fields kBench(required("settings", &BenchDocument::settings,
                                 list_of(kSetting, check_label)));

}  // namespace

BenchDocument parse_bench(std::string_view text, std::string_view name) {
  return parse_document_as<BenchDocument>("bench", kBench, text, name);
}

std::string format_bench(const BenchDocument& bench) {
  return format_document("bench", kBench, bench);
}

BenchDocument read_bench(const std::filesystem::path& file) {
  return parse_bench(read_file(file), file.string());
}

}  // namespace raystage::schemas
