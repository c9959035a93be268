// SPDX-License-Identifier: Apache-2.0
#include "ingest/import_source.h"

#include <system_error>

#include "base/atomic_file.h"
#include "base/error.h"
#include "ingest/colmap_model.h"
#include "ingest/nerf_transforms.h"
#include "schemas/json_text.h"

namespace raystage::ingest {
namespace {

namespace fs = std::filesystem;

bool is_file(const fs::path& path) {
  std::error_code ignored;
  return fs::is_regular_file(path, ignored);
}

bool has_colmap_text(const fs::path& folder) {
  return is_file(folder / "cameras.txt") && is_file(folder / "images.txt");
}

Error unsupported(const fs::path& path, std::string what_happened) {
  return Error::bad_input(
      std::move(what_happened), path.string(),
      "Choose an import manifest (\"schema\": \"raystage/import/1\"), a NeRF transforms.json, or a "
      "COLMAP text model (cameras.txt and images.txt)");
}

ImportSource from_json(const fs::path& file, const ModelImportOptions& options) {
  const std::string text = read_file(file);
  const std::size_t first = text.find_first_not_of(" \t\r\n\xEF\xBB\xBF");
  if (first == text.npos || text[first] != '{') {
    throw unsupported(file, "the format of this file is not supported");
  }
  const nlohmann::json document = schemas::parse_json(text, file.string());
  const fs::path base = file.parent_path();
  if (document.contains("schema") || !document.contains("frames")) {
    if (!document.contains("schema")) {
      throw unsupported(file, "this JSON file has neither \"schema\" nor \"frames\"");
    }
    if (options.images) {
      throw Error::bad_input("an import manifest contains the paths of its images", file.string(),
                             "Remove the folder of images: it is for COLMAP and NeRF models")
          .concerning({"images"});
    }
    return {schemas::parse_import_manifest(text, file.string()), base};
  }
  return {read_nerf_transforms(file, text, options), {}};
}

ImportSource from_folder(const fs::path& folder, const ModelImportOptions& options) {
  if (is_file(folder / "import.json")) return from_json(folder / "import.json", options);
  for (const char* place : {"", "sparse/0", "sparse"}) {
    const fs::path model = *place == '\0' ? folder : folder / place;
    if (has_colmap_text(model)) return {read_colmap_model(model, options), {}};
  }
  if (is_file(folder / "transforms.json")) return from_json(folder / "transforms.json", options);
  for (const char* place : {"cameras.bin", "sparse/0/cameras.bin", "sparse/cameras.bin"}) {
    if (!is_file(folder / place)) continue;
    throw Error::bad_input("this is a binary COLMAP model", (folder / place).string(),
                           "Convert it with colmap model_converter --output_type TXT");
  }
  throw unsupported(folder, "the folder has no supported model or manifest");
}

}  // namespace

ImportSource open_import_source(const fs::path& path, const ModelImportOptions& options) {
  std::error_code ignored;
  if (fs::is_directory(path, ignored)) return from_folder(path, options);
  const fs::path name = path.filename();
  if (name == "cameras.bin" || name == "images.bin") {
    throw Error::bad_input("this is a binary COLMAP model", path.string(),
                           "Convert it with colmap model_converter --output_type TXT");
  }
  if (is_file(path) && (name == "cameras.txt" || name == "images.txt")) {
    const fs::path folder = path.parent_path().empty() ? fs::path(".") : path.parent_path();
    return {read_colmap_model(folder, options), {}};
  }
  return from_json(path, options);
}

}  // namespace raystage::ingest
