// SPDX-License-Identifier: Apache-2.0
// Finds the pictures of cameras that other programs describe. Cost: one listing per camera's
// folder, and one open() per file.
#include "ingest/model_pictures.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <optional>
#include <string_view>
#include <system_error>

#include "base/contained_path.h"
#include "base/error.h"
#include "base/number_text.h"

namespace raystage::ingest {
namespace {

namespace fs = std::filesystem;

constexpr std::array<std::string_view, 6> kPictureExtensions{".jpg", ".jpeg", ".png",
                                                             ".tif", ".tiff", ".exr"};
constexpr std::array<std::string_view, 7> kMovieExtensions{".mp4",  ".mov", ".mkv", ".m4v",
                                                           ".webm", ".avi", ".mxf"};
constexpr std::size_t kMostPictures = 1'000'000;

std::string list_of(std::span<const fs::path> folders) {
  std::string text;
  for (const fs::path& folder : folders) {
    text += (text.empty() ? "" : ", ") + (folder.empty() ? fs::path(".") : folder).string();
  }
  return text;
}

bool is_picture_name(const fs::path& file) {
  std::string extension = file.extension().string();
  for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return std::ranges::find(kPictureExtensions, extension) != kPictureExtensions.end();
}

/// Returns whether there is a regular file. Throws Error (bad input) for a link that is not
/// permitted, and for what cannot be read.
bool is_contained_file(const ContainedPath& file) {
  const FileDescriptor opened = open_contained_to_read(file);
  if (!opened.open()) {
    if (errno == ENOENT || errno == ENOTDIR) return false;
    throw contained_open_error(file, errno);
  }
  struct stat status {};
  return fstat(opened.number(), &status) == 0 && S_ISREG(status.st_mode);
}

/// Numbers the pictures by their names, if all names are numbers, or else by their order.
void number_pictures(std::vector<CameraPictures::Picture>& pictures) {
  std::ranges::sort(pictures, {}, &CameraPictures::Picture::file);
  const auto number_of = [](const CameraPictures::Picture& picture) -> std::optional<std::int64_t> {
    constexpr std::size_t kMostDigits = 15;
    const std::string stem = picture.file.stem().string();
    if (stem.size() > kMostDigits || stem.starts_with('-')) return std::nullopt;
    return parse_number<std::int64_t>(stem);
  };
  const bool numbered =
      std::ranges::all_of(pictures, [&](const auto& p) { return number_of(p).has_value(); });
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    pictures[i].number = numbered ? *number_of(pictures[i]) : static_cast<std::int64_t>(i);
  }
  std::ranges::stable_sort(pictures, {}, &CameraPictures::Picture::number);
  const auto twice = std::ranges::adjacent_find(pictures, {}, &CameraPictures::Picture::number);
  if (twice == pictures.end()) return;
  throw Error::bad_input(
      fmt::format("it is frame {}, as \"{}\" is", twice->number, twice->file.filename().string()),
      std::next(twice)->file.string(), "Keep one picture of each frame");
}

/// Returns the pictures in FOLDER/ID, if there is such a folder.
std::vector<CameraPictures::Picture> pictures_in(const fs::path& folder, const std::string& id) {
  std::vector<CameraPictures::Picture> found;
  std::error_code error;
  if (!fs::is_directory(folder / id, error)) return found;
  for (fs::directory_iterator entry(folder / id, error), end; !error && entry != end;
       entry.increment(error)) {
    const fs::path name = entry->path().filename();
    if (name.string().starts_with('.') || !is_picture_name(name)) continue;
    if (!is_contained_file({folder, id / name})) continue;
    if (found.size() == kMostPictures) {
      throw Error::bad_input(fmt::format("found more than {} pictures", kMostPictures),
                             (folder / id).string(), "Import the pictures in parts");
    }
    found.push_back({folder / id / name});
  }
  if (error) {
    throw Error::bad_input("the folder cannot be read: " + error.message(), (folder / id).string(),
                           "Check its permissions");
  }
  number_pictures(found);
  return found;
}

/// Returns FOLDER/ID with the first of the extensions of which there is a file, or an empty path.
fs::path file_of(const fs::path& folder, const std::string& id,
                 std::span<const std::string_view> extensions) {
  for (const std::string_view extension : extensions) {
    const std::string name = id + std::string(extension);
    if (is_contained_file({folder, name})) return folder / name;
  }
  return {};
}

std::optional<CameraPictures> pictures_of(const fs::path& folder, const std::string& id) {
  std::error_code ignored;
  const fs::path existing = folder.empty() ? fs::path(".") : folder;
  if (!fs::is_directory(existing, ignored)) return std::nullopt;
  CameraPictures result;
  result.pictures = pictures_in(existing, id);
  if (!result.pictures.empty()) return result;
  result.movie = file_of(existing, id, kMovieExtensions);
  if (!result.movie.empty()) return result;
  const fs::path still = file_of(existing, id, kPictureExtensions);
  if (still.empty()) return std::nullopt;
  result.pictures = {{still}};
  return result;
}

/// The user's permission to follow links out of folders includes paths that leave them.
bool may_leave_folders() { return permits_links(); }

bool leaves_folder_of_images(const fs::path& image) {
  const fs::path plain = image.lexically_normal();
  return plain.is_absolute() || plain.empty() || *plain.begin() == "..";
}

Error no_pictures(const ForeignRig::Camera& camera, const std::string& searched) {
  const std::string& id = camera.geometry.id;
  return Error::bad_input(
             fmt::format("the camera \"{0}\" has no pictures in {1}: neither a folder {0} with "
                         "pictures, nor a movie {0}.mp4, nor a picture {0}.jpg, or with another "
                         "usual extension",
                         id, searched),
             camera.place, "Set the folder of the pictures")
      .concerning({"images"});
}

}  // namespace

fs::path find_named_picture(std::span<const fs::path> folders, const std::string& image,
                            const std::string& place) {
  std::error_code ignored;
  const bool leaves = leaves_folder_of_images(image);
  if (leaves && !may_leave_folders()) {
    throw Error::bad_input(
        fmt::format("the image \"{}\" is named by a path that leaves the folder of the images",
                    image),
        place,
        "Name it below that folder, such as \"images/0001.jpg\"; if you trust the file, permit "
        "that links are followed, too")
        .concerning({"images"});
  }
  for (const fs::path& folder : folders) {
    const fs::path existing = folder.empty() ? fs::path(".") : folder;
    for (const char* extension :
         {"", ".png", ".jpg", ".jpeg", ".PNG", ".JPG", ".JPEG", ".exr", ".tif", ".tiff"}) {
      const std::string name = image + extension;
      const bool is_there = leaves ? fs::is_regular_file(existing / name, ignored)
                                   : is_contained_file({existing, name});
      if (is_there) return existing / name;
    }
  }
  throw Error::bad_input(
      fmt::format("the image \"{}\" was not found, with or without an extension, in {}", image,
                  list_of(folders)),
      place, "Set the folder of the images")
      .concerning({"images"});
}

std::vector<CameraPictures> find_pictures_by_id(std::span<const fs::path> folders,
                                                std::span<const ForeignRig::Camera> cameras) {
  std::vector<CameraPictures> result;
  const fs::path* base = nullptr;
  for (const ForeignRig::Camera& camera : cameras) {
    std::optional<CameraPictures> found;
    if (base != nullptr) {
      found = pictures_of(*base, camera.geometry.id);
    } else {
      for (std::size_t i = 0; i < folders.size() && !found; ++i) {
        found = pictures_of(folders[i], camera.geometry.id);
        if (found) base = &folders[i];
      }
    }
    if (!found) {
      throw no_pictures(camera, list_of(base == nullptr ? folders : std::span(base, 1)));
    }
    result.push_back(std::move(*found));
  }
  return result;
}

}  // namespace raystage::ingest
