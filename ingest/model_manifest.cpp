// SPDX-License-Identifier: Apache-2.0
// Makes import manifests for camera models of other programs: names, camera ids and the folder of
// the images.
#include "ingest/model_manifest.h"

#include <fmt/format.h>

#include <map>
#include <set>
#include <system_error>

#include "base/error.h"
#include "base/options.h"

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

bool ModelImportOptions::is_valid(std::string* reason) const {
  return is_within("nominal rate (frames per second)", nominal_fps, 1e-3, 1e6, reason);
}

schemas::ImportManifest make_model_manifest(const std::filesystem::path& file,
                                            const ModelImportOptions& options) {
  schemas::ImportManifest manifest;
  std::error_code ignored;
  const auto folder = std::filesystem::weakly_canonical(file, ignored).parent_path();
  manifest.name = folder.filename().string();
  manifest.epoch_utc = options.epoch_utc;
  manifest.nominal_fps = options.nominal_fps;
  manifest.color_space = "srgb_texture";
  manifest.arbitrary_scale = true;  // neither format has a unit
  return manifest;
}

std::vector<std::string> make_camera_ids(std::span<const std::string> image_names) {
  std::map<std::string, int> stems;
  for (const std::string& name : image_names) ++stems[safe_id(stem_of(name))];
  std::set<std::string> taken;
  std::vector<std::string> ids;
  for (const std::string& name : image_names) {
    std::string id = safe_id(stem_of(name));
    if (stems[id] > 1) id = safe_id(path_without_extension(name));
    const std::string base = id;
    for (int number = 2; !taken.insert(id).second; ++number) {
      id = fmt::format("{}-{}", base, number);
    }
    ids.push_back(id);
  }
  return ids;
}

std::filesystem::path find_image_folder(std::span<const std::filesystem::path> folders,
                                        const std::string& image,
                                        const std::filesystem::path& model) {
  std::string searched;
  for (const std::filesystem::path& folder : folders) {
    std::error_code ignored;
    if (std::filesystem::is_regular_file(folder / image, ignored)) return folder;
    if (!searched.empty()) searched += ", ";
    searched += folder.string();
  }
  throw Error::bad_input(
      fmt::format("the model's image \"{}\" was not found in {}", image, searched), model.string(),
      "Set the folder of the images")
      .concerning({"images"});
}

}  // namespace raystage::ingest
