// SPDX-License-Identifier: Apache-2.0
#include "replay/shot_paths.h"

#include <array>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/error.h"
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

std::vector<fs::path> shot_paths(std::string_view text, const fs::path& from) {
  nlohmann::json json = schemas::parse_json(text, "shot");
  std::vector<fs::path> paths;
  for (const char* const pointer : kPaths) {
    change_at(json, pointer, [&](const nlohmann::json& value) {
      const fs::path path(value.get<std::string>());
      if (path.empty()) return;
      fs::path whole = (from / path).lexically_normal();
      if (!whole.has_filename()) whole = whole.parent_path();  // of "take/"
      paths.push_back(std::move(whole));
    });
  }
  return paths;
}

}  // namespace raystage::replay
