// SPDX-License-Identifier: Apache-2.0
#include "schemas/import_manifest.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <numbers>

#include "base/atomic_file.h"
#include "schemas/document.h"

namespace raystage {
namespace {

using Vector3 = std::array<double, 3>;

double dot(const Vector3& a, const Vector3& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

Vector3 viewing_direction(const CameraGeometry& camera) {
  const Matrix4& m = camera.world_from_camera;
  return {-m[2], -m[6], -m[10]};
}

Vector3 centre(const CameraGeometry& camera) {
  const Matrix4& m = camera.world_from_camera;
  return {m[3], m[7], m[11]};
}

/// A depth range is counted from the middle of the array along its mean viewing direction. It means
/// something only where every camera has the whole range before it: none looks back, and none
/// stands beyond the nearest plane.
void check_depth_range(const ImportManifest& manifest, const JsonNode& cameras) {
  if (!manifest.depth_range) return;
  const auto count = static_cast<double>(manifest.cameras.size());
  Vector3 forward{}, middle{};
  for (const auto& camera : manifest.cameras) {
    for (std::size_t i = 0; i < 3; ++i) {
      forward[i] += viewing_direction(camera.geometry)[i] / count;
      middle[i] += centre(camera.geometry)[i] / count;
    }
  }
  const double length = std::sqrt(dot(forward, forward));
  constexpr double kNoDirection = 1e-3;
  if (length < kNoDirection) {
    throw cameras.input_error(
        "the cameras look every way, so a depth range in front of the array is undefined",
        "Remove \"depth_range_m\", or correct \"world_from_camera\"");
  }
  for (double& value : forward) value /= length;
  for (std::size_t i = 0; i < manifest.cameras.size(); ++i) {
    const CameraGeometry& camera = manifest.cameras[i].geometry;
    const JsonNode matrix = cameras.at(i).at("world_from_camera");
    const double cosine = dot(viewing_direction(camera), forward);
    if (cosine <= 0) {
      const double degrees = std::acos(std::max(cosine, -1.0)) * 180 / std::numbers::pi;
      throw matrix.input_error(
          fmt::format("the camera \"{}\" looks {:.1f} degrees away from the mean of the array, "
                      "allowed with a depth range: less than 90",
                      camera.id, degrees),
          "A camera looks down -z with y up: turn matrices of OpenCV or COLMAP (y down, +z "
          "forward) by negating their second and third column");
    }
    const Vector3 c = centre(camera);
    const double advance = dot({c[0] - middle[0], c[1] - middle[1], c[2] - middle[2]}, forward);
    if (advance >= manifest.depth_range->near) {
      throw matrix.input_error(
          fmt::format(
              "the camera \"{}\" stands {:.6g} m in front of the array's middle, beyond the "
              "nearest plane of the depth range at {:.6g} m, which is behind it",
              camera.id, advance, manifest.depth_range->near),
          "Correct the position or \"depth_range_m\"");
    }
  }
}

/// Throws Error (bad input) for a time that is not after the previous one.
class IncreasingTimes {
 public:
  Nanoseconds next(const JsonNode& time) {
    const auto value = time.get<Nanoseconds>();
    if (value <= last_) {
      throw time.input_error(
          fmt::format("found {} after {}, allowed: increasing times", value, last_),
          "Sort the frames by time and list each once");
    }
    return last_ = value;
  }

 private:
  Nanoseconds last_ = -1;
};

ImportManifest::Camera import_camera_from(const JsonNode& object,
                                          std::set<std::string, std::less<>>& seen) {
  ImportManifest::Camera camera{camera_from(object, seen), {}, {}, {}};
  const bool movie = object.has("movie");
  if (movie != object.has("times_ns") || movie == object.has("frames")) {
    throw object.input_error(
        fmt::format("the camera \"{}\" has {}\"frames\", {}\"movie\" and {}\"times_ns\", allowed: "
                    "either \"frames\", or \"movie\" with \"times_ns\"",
                    camera.geometry.id, object.has("frames") ? "" : "no ", movie ? "" : "no ",
                    object.has("times_ns") ? "" : "no "),
        "Keep one of the two forms");
  }
  IncreasingTimes times;
  if (movie) {
    camera.movie = path_from(object.at("movie"));
    const JsonNode list = object.at("times_ns");
    for (std::size_t i = 0; i < list.size(); ++i) camera.times_ns.push_back(times.next(list.at(i)));
    return camera;
  }
  const JsonNode frames = object.at("frames");
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const JsonNode frame = frames.at(i);
    camera.frames.push_back({path_from(frame.at("file")), times.next(frame.at("time_ns"))});
  }
  return camera;
}

}  // namespace

ImportManifest parse_import_manifest(std::string_view text, std::string_view name) {
  const nlohmann::json json = parse_document("import", text, name);
  const JsonNode document{json, name, ""};
  ImportManifest manifest;
  manifest.name = document.at("name").get<std::string>();
  manifest.epoch_utc = utc_from(document.at("epoch_utc"));
  manifest.nominal_fps = document.at("nominal_fps").get<double>();
  manifest.color_space = document.at("color_space").get<std::string>();
  manifest.arbitrary_scale = document.get<std::string>("scale", "metres") == "arbitrary";
  manifest.depth_range = depth_range_from(document);
  const JsonNode cameras = document.at("cameras");
  std::set<std::string, std::less<>> seen;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    manifest.cameras.push_back(import_camera_from(cameras.at(i), seen));
  }
  check_depth_range(manifest, cameras);
  return manifest;
}

std::string format_import_manifest(const ImportManifest& manifest) {
  nlohmann::ordered_json json = make_document("import");
  json["name"] = manifest.name;
  json["epoch_utc"] = format_utc(manifest.epoch_utc);
  json["nominal_fps"] = manifest.nominal_fps;
  json["color_space"] = manifest.color_space;
  if (manifest.arbitrary_scale) json["scale"] = "arbitrary";
  add_depth_range(manifest.depth_range, json);
  auto& cameras = json["cameras"] = nlohmann::ordered_json::array();
  for (const ImportManifest::Camera& camera : manifest.cameras) {
    nlohmann::ordered_json object = json_from(camera.geometry);
    if (camera.movie.empty()) {
      auto& frames = object["frames"] = nlohmann::ordered_json::array();
      for (const ImportManifest::Frame& frame : camera.frames) {
        frames.push_back({{"file", frame.file}, {"time_ns", frame.time_ns}});
      }
    } else {
      object["movie"] = camera.movie;
      object["times_ns"] = camera.times_ns;
    }
    cameras.push_back(std::move(object));
  }
  return format_json(json);
}

ImportManifest read_import_manifest(const std::filesystem::path& file) {
  return parse_import_manifest(read_file(file), file.string());
}

void write_import_manifest(const ImportManifest& manifest, const std::filesystem::path& file) {
  const std::string text = format_import_manifest(manifest);
  parse_import_manifest(text, file.string());  // what cannot be read again must not be written
  write_file_atomically(file, text);
}

}  // namespace raystage
