// SPDX-License-Identifier: Apache-2.0
#include "farm/path_map.h"

#include "base/atomic_file.h"
#include "base/error.h"
#include "schemas/json_text.h"

namespace raystage::farm {
namespace {

std::string without_slash(std::string folder) {
  while (folder.size() > 1 && folder.back() == '/') folder.pop_back();
  return folder;
}

void map_strings(nlohmann::ordered_json& value, std::span<const PathMappingRule> rules) {
  if (value.is_string()) {
    value = map_path(value.get<std::string>(), rules);
  } else if (value.is_structured()) {
    for (auto& item : value) map_strings(item, rules);
  }
}

}  // namespace

PathMappingRule parse_path_rule(std::string_view text) {
  const std::size_t equals = text.find('=');
  const std::string from(text.substr(0, equals));
  const std::string to(equals == std::string_view::npos ? "" : text.substr(equals + 1));
  if (from.empty() || to.empty() || from.front() != '/' || to.front() != '/') {
    throw Error::bad_input(
        "found \"" + std::string(text) + "\", allowed: FROM=TO, two absolute paths", "path mapping",
        "Write for example /mnt/show=/net/show");
  }
  return {without_slash(from), without_slash(to)};
}

std::vector<PathMappingRule> read_path_mapping(const std::filesystem::path& file) {
  const nlohmann::json json = schemas::parse_json(read_file(file), file.string());
  const auto refuse = [&](const std::string& pointer) {
    return schemas::json_value_error(file.string(), pointer,
                                     "the file is not a path mapping of version pathmapping-1.0",
                                     "Use the file that the session names");
  };
  if (!json.is_object() || json.value("version", nlohmann::json()) != "pathmapping-1.0") {
    throw refuse("/version");
  }
  std::vector<PathMappingRule> rules;
  if (!json.contains("path_mapping_rules")) return rules;  // a session without rules
  if (!json["path_mapping_rules"].is_array()) throw refuse("/path_mapping_rules");
  for (const nlohmann::json& rule : json["path_mapping_rules"]) {
    if (!rule.is_object() || !rule.contains("source_path") || !rule["source_path"].is_string() ||
        !rule.contains("destination_path") || !rule["destination_path"].is_string()) {
      throw refuse("/path_mapping_rules");
    }
    if (rule.value("source_path_format", nlohmann::json("POSIX")) != "POSIX") continue;
    rules.push_back({without_slash(rule["source_path"].get<std::string>()),
                     without_slash(rule["destination_path"].get<std::string>())});
  }
  return rules;
}

bool path_rule_matches(const PathMappingRule& rule, std::string_view path) {
  if (!path.starts_with(rule.from)) return false;
  const std::string_view rest = path.substr(rule.from.size());
  return rest.empty() || rest.front() == '/' || rule.from.back() == '/';
}

std::string map_path(const std::string& path, std::span<const PathMappingRule> rules) {
  for (const PathMappingRule& rule : rules) {
    if (path_rule_matches(rule, path)) return rule.to + path.substr(rule.from.size());
  }
  return path;
}

void map_paths(schemas::FarmJobDocument& job, std::span<const PathMappingRule> rules) {
  for (std::string* path :
       {&job.folder, &job.shot_folder, &job.output, &job.cache, &job.color_config}) {
    *path = map_path(*path, rules);
  }
  for (schemas::FarmJobDocument::PrepareTask& instant : job.instants)
    instant.file = map_path(instant.file, rules);
  for (std::string& file : job.inputs) file = map_path(file, rules);
  for (std::string& file : job.pinned) file = map_path(file, rules);
}

std::string map_shot_paths(std::string_view shot_text, std::string_view name,
                           std::span<const PathMappingRule> rules) {
  if (rules.empty()) return std::string(shot_text);
  nlohmann::ordered_json json = schemas::parse_json(shot_text, name);
  map_strings(json, rules);
  return schemas::format_json(json);
}

std::vector<PathMappingRule> local_path_rules(const schemas::FarmJobDocument& job,
                                              const std::filesystem::path& folder) {
  std::error_code ignored;
  std::vector<PathMappingRule> reversed;
  if (std::filesystem::equivalent(job.folder, folder, ignored)) return reversed;
  for (const PathMappingRule& rule : job.paths) reversed.push_back({rule.to, rule.from});
  return reversed;
}

}  // namespace raystage::farm
