// SPDX-License-Identifier: Apache-2.0
#include "ingest/import_source.h"

#include <system_error>

#include "base/error.h"
#include "ingest/model_pictures.h"
#include "ingest/rig_formats/rig_format.h"
#include "ingest/source_image.h"
#include "schemas/json_text.h"

namespace raystage::ingest {
namespace {

namespace fs = std::filesystem;

bool is_file(const fs::path& path) {
  std::error_code ignored;
  return fs::is_regular_file(path, ignored);
}

Error unsupported(const fs::path& path, std::string what_happened) {
  std::string choice = "Choose one of these: import manifest (\"schema\": \"raystage/import/1\")";
  const auto formats = rig_formats();
  for (const RigFormat* format : formats) {
    choice += format == formats.back() ? "; or " : "; ";
    choice += format->description();
  }
  return Error::bad_input(std::move(what_happened), path.string(), std::move(choice));
}

JsonOutline outline_of(const nlohmann::json& document) {
  JsonOutline outline;
  outline.is_list = document.is_array();
  const nlohmann::json& object = outline.is_list && !document.empty() ? document[0] : document;
  if (object.is_object()) {
    for (const auto& [key, value] : object.items()) outline.keys.push_back(key);
  }
  return outline;
}

std::vector<fs::path> picture_folders_of(const RigFormat& format, const fs::path& folder,
                                         const ModelImportOptions& options) {
  const bool only_these = options.images.has_value();
  std::vector<fs::path> folders;
  for (const std::string& relative : format.picture_folders()) {
    // Below the given folder, but not outside of it.
    if (only_these && relative.starts_with("..")) continue;
    const fs::path base = only_these ? *options.images : folder;
    folders.push_back(relative.empty() ? base : base / relative);
  }
  return folders;
}

ImportSource from_model(const RigFormat& format, std::vector<NamedText> files,
                        const ModelImportOptions& options) {
  const fs::path file = files.front().name;
  const std::vector<fs::path> folders = picture_folders_of(format, file.parent_path(), options);
  PictureSizeReader size_of_picture;
  if (options.has_pictures) {
    size_of_picture = [&](const std::string& image, const std::string& place) -> PictureSize {
      const images::ImageReader reader;
      const SourceImageSize size = image_size(reader, find_named_picture(folders, image, place));
      return {size.width, size.height};
    };
  }
  const ForeignRig rig = format.parse(files, size_of_picture);
  return {make_model_manifest(rig, file, folders, options), {}, rig.notes};
}

ImportSource from_json(const fs::path& file, const ModelImportOptions& options) {
  std::string text = read_file(file);
  const std::size_t first = text.find_first_not_of(" \t\r\n\xEF\xBB\xBF");
  if (first == text.npos || (text[first] != '{' && text[first] != '[')) {
    throw unsupported(file, "the format of this file is not supported");
  }
  const JsonOutline outline = outline_of(schemas::parse_json(text, file.string()));
  if (outline.is_list || !outline.has("schema")) {
    const RigFormat* format = detect_rig_format(outline);
    if (format == nullptr) {
      throw unsupported(file, outline.is_list
                                  ? "the format of this file is not supported"
                                  : "this JSON file has neither \"schema\" nor \"frames\" nor "
                                    "\"cameras\"");
    }
    return from_model(*format, {{file.string(), std::move(text)}}, options);
  }
  if (options.images) {
    throw Error::bad_input("an import manifest contains the paths of its images", file.string(),
                           "Remove the folder of images: it is for models of other programs")
        .concerning({"images"});
  }
  return {schemas::parse_import_manifest(text, file.string()), file.parent_path()};
}

/// Returns whether a folder has the files that a format needs.
bool has_files(const RigFormat& format, const fs::path& folder) {
  const std::vector<std::string> names = format.files();
  for (std::size_t i = 0; i < format.needed_files(); ++i) {
    if (!is_file(folder / names[i])) return false;
  }
  return true;
}

ImportSource from_files(const RigFormat& format, const fs::path& folder,
                        const ModelImportOptions& options) {
  const std::vector<std::string> names = format.files();
  if (format.needed_files() == 1) return from_json(folder / names[0], options);
  std::vector<NamedText> files;
  for (std::size_t i = 0; i < format.needed_files(); ++i) {
    const fs::path file = folder / names[i];
    files.push_back({file.string(), read_file(file, format.max_bytes())});
  }
  return from_model(format, std::move(files), options);
}

ImportSource from_folder(const fs::path& folder, const ModelImportOptions& options) {
  if (is_file(folder / "import.json")) return from_json(folder / "import.json", options);
  for (const RigFormat* format : rig_formats()) {
    for (const std::string& place : format->model_folders()) {
      const fs::path model = place.empty() ? folder : folder / place;
      if (has_files(*format, model)) return from_files(*format, model, options);
    }
  }
  for (const RigFormat* format : rig_formats()) format->check_variant(folder);
  throw unsupported(folder, "the folder has no supported model or manifest");
}

/// Returns the format of several files of which this is one, or null.
const RigFormat* format_of_several_files(const fs::path& file) {
  for (const RigFormat* format : rig_formats()) {
    const std::vector<std::string> names = format->files();
    for (std::size_t i = 0; format->needed_files() > 1 && i < format->needed_files(); ++i) {
      if (file.filename() == names[i] && is_file(file)) return format;
    }
  }
  return nullptr;
}

}  // namespace

ImportSource open_import_source(const fs::path& path, const ModelImportOptions& options) {
  std::error_code ignored;
  if (fs::is_directory(path, ignored)) return from_folder(path, options);
  for (const RigFormat* format : rig_formats()) format->check_variant(path);
  if (const RigFormat* format = format_of_several_files(path)) {
    const fs::path folder = path.parent_path().empty() ? fs::path(".") : path.parent_path();
    return from_files(*format, folder, options);
  }
  return from_json(path, options);
}

}  // namespace raystage::ingest
