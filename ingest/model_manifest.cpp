// SPDX-License-Identifier: Apache-2.0
// Makes import manifests of rigs of other programs: names, times and pictures.
#include "ingest/model_manifest.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <system_error>

#include "base/error.h"
#include "base/options.h"
#include "ingest/model_pictures.h"
#include "ingest/movie_reader.h"
#include "schemas/utf8_text.h"

namespace raystage::ingest {
namespace {

constexpr Nanoseconds kLastTime = 8'985'600'000'000'000;  // 104 days, as in manifests

/// Returns the rate of all movies, or the default if there is none. Throws Error (bad input) if the
/// rates differ.
double rate_of_movies(std::span<const CameraPictures> cameras) {
  constexpr double kSameRate = 1e-6;
  const CameraPictures* first = nullptr;
  double rate = ModelImportOptions::kDefaultFps;
  for (const CameraPictures& camera : cameras) {
    if (camera.movie.empty()) continue;
    const double own = MovieReader(camera.movie).frame_rate();
    if (!(own > 0)) continue;
    if (first == nullptr) {
      first = &camera;
      rate = own;
    } else if (std::abs(own - rate) > kSameRate * rate) {
      throw Error::bad_input(
          fmt::format("the movie has {:.6g} frames per second, but {} has {:.6g}", own,
                      first->movie.string(), rate),
          camera.movie.string(),
          "Convert the movies to one rate, or set the rate at which all were recorded")
          .concerning({"fps"});
    }
  }
  return rate;
}

void add_pictures(const CameraPictures& found, std::int64_t first_number, double fps,
                  schemas::ImportManifest::Camera& camera) {
  camera.movie = found.movie.string();
  for (const CameraPictures::Picture& picture : found.pictures) {
    const double time = std::round(static_cast<double>(picture.number - first_number) *
                                   static_cast<double>(kNanosecondsPerSecond) / fps);
    const auto refuse = [&](std::string why) {
      return Error::bad_input(std::move(why), picture.file.string(),
                              "Number the pictures from 0, or correct the frame rate")
          .concerning({"fps"});
    };
    if (time > static_cast<double>(kLastTime)) {
      throw refuse(fmt::format("frame {} is later than 104 days at {:.6g} frames per second",
                               picture.number, fps));
    }
    camera.frames.push_back({picture.file.string(), static_cast<Nanoseconds>(time)});
  }
}

std::int64_t first_number_of(std::span<const CameraPictures> cameras) {
  std::int64_t first = std::numeric_limits<std::int64_t>::max();
  for (const CameraPictures& camera : cameras) {
    if (!camera.pictures.empty()) first = std::min(first, camera.pictures.front().number);
  }
  return first;
}

/// Adds the pictures of cameras that name none.
void add_pictures_by_id(const ForeignRig& rig, std::span<const std::filesystem::path> folders,
                        const ModelImportOptions& options, schemas::ImportManifest& manifest) {
  const std::vector<CameraPictures> found = find_pictures_by_id(folders, rig.cameras);
  if (!options.nominal_fps) manifest.nominal_fps = rate_of_movies(found);
  const std::int64_t first = first_number_of(found);
  for (std::size_t i = 0; i < found.size(); ++i) {
    add_pictures(found[i], first, manifest.nominal_fps, manifest.cameras[i]);
  }
}

}  // namespace

bool ModelImportOptions::is_valid(std::string* reason) const {
  return is_within("nominal rate (frames per second)", nominal_fps.value_or(kDefaultFps), 1e-3, 1e6,
                   reason);
}

schemas::ImportManifest make_model_manifest(const ForeignRig& rig,
                                            const std::filesystem::path& file,
                                            std::span<const std::filesystem::path> picture_folders,
                                            const ModelImportOptions& options) {
  require_valid(options, "import");
  schemas::ImportManifest manifest;
  std::error_code ignored;
  const auto folder = std::filesystem::weakly_canonical(file, ignored).parent_path();
  constexpr std::size_t kLongestFileName = 255;
  manifest.name = schemas::utf8_text(folder.filename().string(), kLongestFileName);
  manifest.epoch_utc = options.epoch_utc;
  manifest.nominal_fps = options.nominal_fps.value_or(ModelImportOptions::kDefaultFps);
  manifest.color_space = "srgb_texture";
  manifest.arbitrary_scale = rig.arbitrary_scale;
  bool by_id = false;
  for (const ForeignRig::Camera& camera : rig.cameras) {
    manifest.cameras.push_back(
        {.geometry = camera.geometry, .frames = {}, .movie = {}, .times_ns = {}});
    if (camera.image.empty()) {
      by_id = true;
    } else if (options.has_pictures) {
      const auto picture = find_named_picture(picture_folders, camera.image, camera.place);
      manifest.cameras.back().frames.push_back({picture.string(), 0});
    }
  }
  if (by_id && options.has_pictures) add_pictures_by_id(rig, picture_folders, options, manifest);
  return manifest;
}

}  // namespace raystage::ingest
