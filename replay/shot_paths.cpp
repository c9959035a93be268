// SPDX-License-Identifier: Apache-2.0
#include "replay/shot_paths.h"

#include <array>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/error.h"
#include "render/methods.h"
#include "schemas/json_text.h"
#include "schemas/utf8_text.h"

namespace raystage::replay {
namespace {

namespace fs = std::filesystem;

/// Where schemas/shot.schema.json has paths, as JSON pointers; "*": all items of an array.
constexpr std::array kPaths{"/camera/file/path",          "/layers/*/take",
                            "/layers/*/geometry/file",    "/layers/*/geometry/material/texture",
                            "/layers/*/plate/file",       "/layers/*/matte/clean_plate_take",
                            "/layers/*/matte/empty_take", "/lights/*/environment",
                            "/output/color/config"};

/// Calls `change` with each text at a pointer.
template <class Json, class Change>
void change_at(Json& json, std::string_view pointer, const Change& change) {
  if (pointer.empty()) {
    if (json.is_string()) change(json);
    return;
  }
  pointer.remove_prefix(1);
  const std::size_t end = std::min(pointer.find('/'), pointer.size());
  const std::string name(pointer.substr(0, end));
  const std::string_view rest = pointer.substr(end);
  if (name == "*") {
    if (!json.is_array()) return;
    for (Json& item : json) change_at(item, rest, change);
  } else if (json.is_object() && json.contains(name)) {
    change_at(json[name], rest, change);
  }
}

}  // namespace

std::string rebase_shot_paths(std::string_view text, const fs::path& from, const fs::path& to) {
  schemas::parse_json(text, "shot");  // which limits the nesting, but sorts the properties
  using Json = nlohmann::ordered_json;
  Json json = Json::parse(text);
  if (!json.is_object()) {
    throw Error::bad_input("this is no JSON object", "shot", "Give the text of a shot");
  }
  for (const char* const pointer : kPaths) {
    change_at(json, pointer, [&](Json& value) {
      const fs::path path(value.get<std::string>());
      if (path.empty() || path.is_absolute()) return;
      fs::path rebased = (from / path).lexically_normal();
      if (!rebased.has_filename()) rebased = rebased.parent_path();  // of "take/" or "."
      std::string relative = rebased.lexically_relative(to).string();
      if (!schemas::is_utf8(relative)) {
        throw Error::bad_input("the path of a file of the shot is not UTF-8, as JSON has to be",
                               rebased.string(), "Rename the folder, or move the shot");
      }
      value = std::move(relative);
    });
  }
  return schemas::dump_json(json) + "\n";
}

namespace {

/// `from`: where the path starts, which may itself be a link unless `is_plain`.
ShotPath shot_path(const fs::path& from, bool is_plain, const fs::path& path) {
  ShotPath result{from / path, (from / path).lexically_normal(), true};
  bool may_be_link = !is_plain;  // the part before
  for (const fs::path& part : path) {
    if (part == ".." && may_be_link) result.is_unambiguous = false;
    may_be_link = may_be_link || part != "..";
  }
  if (!result.normal.has_filename()) result.normal = result.normal.parent_path();  // of "take/"
  return result;
}

void add_option_paths(const nlohmann::json& layer, const fs::path& from,
                      std::vector<ShotPath>& paths) {
  if (!layer.is_object() || !layer.contains("options") || !layer["options"].is_object()) return;
  const nlohmann::json& options = layer["options"];
  const std::string take = layer.contains("take") && layer["take"].is_string()
                               ? layer["take"].get<std::string>()
                               : std::string();
  const fs::path folder = shot_path(from, true, take).normal;
  for (const render::Method* const method : render::methods()) {
    for (const render::OptionSpec& option : method->options()) {
      if (option.kind != render::OptionSpec::Kind::kText) continue;
      for (const std::string_view name : {option.name, option.former}) {
        const auto found = options.find(std::string(name));
        if (found == options.end() || !found->is_string()) continue;
        const fs::path path(found->get<std::string>());
        if (!path.empty()) paths.push_back(shot_path(folder, false, path));
      }
    }
  }
}

}  // namespace

std::vector<ShotPath> shot_paths(std::string_view text, const fs::path& from) {
  nlohmann::json json = schemas::parse_json(text, "shot");
  std::vector<ShotPath> paths;
  for (const char* const pointer : kPaths) {
    change_at(json, pointer, [&](const nlohmann::json& value) {
      const fs::path path(value.get<std::string>());
      if (!path.empty()) paths.push_back(shot_path(from, true, path));
    });
  }
  if (json.is_object() && json.contains("layers") && json["layers"].is_array()) {
    for (const nlohmann::json& layer : json["layers"]) add_option_paths(layer, from, paths);
  }
  return paths;
}

}  // namespace raystage::replay
