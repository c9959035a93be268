// SPDX-License-Identifier: Apache-2.0
#include "ingest/rig_formats/camera_ids.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <set>

namespace raystage::ingest {
namespace {

constexpr std::size_t kLongestId = 90;  // leaves 10 of an id's 100 characters for a number

std::string safe_id(std::string text) {
  if (text.size() > kLongestId) text.erase(0, text.size() - kLongestId);
  for (char& c : text) {
    const bool safe = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                      c == '.' || c == '_' || c == '-';
    if (!safe) c = '_';
  }
  if (text.empty() || text[0] == '.') text.insert(0, "_");
  return text;
}

std::string stem_of(const std::string& name) { return std::filesystem::path(name).stem().string(); }

std::string path_without_extension(const std::string& name) {
  return std::filesystem::path(name).lexically_normal().replace_extension().generic_string();
}

}  // namespace

std::vector<std::string> make_camera_ids(std::span<const std::string> image_names) {
  std::map<std::string, int> stems;
  for (const std::string& name : image_names) ++stems[safe_id(stem_of(name))];
  std::set<std::string> taken;
  std::map<std::string, int> next;  // number of a base, so that equal names cost no search
  std::vector<std::string> ids;
  for (const std::string& name : image_names) {
    std::string id = safe_id(stem_of(name));
    if (stems[id] > 1) id = safe_id(path_without_extension(name));
    const std::string base = id;
    while (!taken.insert(id).second) {
      int& number = next.try_emplace(base, 2).first->second;
      id = fmt::format("{}-{}", base, number++);
    }
    ids.push_back(id);
  }
  return ids;
}

bool has_control_characters(std::string_view name) {
  return std::ranges::any_of(name, [](unsigned char c) { return c < 0x20 || c == 0x7F; });
}

}  // namespace raystage::ingest
