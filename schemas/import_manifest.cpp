// SPDX-License-Identifier: Apache-2.0
#include "schemas/import_manifest.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <numbers>

#include "schemas/fields.h"

namespace raystage::schemas {
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

Vector3 difference(const Vector3& a, const Vector3& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}

/// Where the cameras of an array are, and where they look.
struct ArrayAim {
  Vector3 centre{}, forward{};
  double agreement = 0;  ///< length of the mean viewing direction; `forward` has length 1
  /// Mean distance of a camera from the centre in its own viewing direction, as a share of the mean
  /// distance: 1 for a sphere that looks outwards.
  double outward = 0;
  bool all_pinholes = true;
};

ArrayAim aim_of(const ImportManifest& manifest) {
  ArrayAim aim;
  const auto count = static_cast<double>(manifest.cameras.size());
  for (const auto& camera : manifest.cameras) {
    for (std::size_t i = 0; i < 3; ++i) {
      aim.forward[i] += viewing_direction(camera.geometry)[i] / count;
      aim.centre[i] += centre(camera.geometry)[i] / count;
    }
    const bool pinhole = camera.geometry.intrinsics.projection == Projection::kPinhole;
    aim.all_pinholes = aim.all_pinholes && pinhole;
  }
  double along = 0, distance = 0;
  for (const auto& camera : manifest.cameras) {
    const Vector3 from_centre = difference(centre(camera.geometry), aim.centre);
    along += dot(from_centre, viewing_direction(camera.geometry));
    distance += std::sqrt(dot(from_centre, from_centre));
  }
  if (distance > 0) aim.outward = along / distance;
  aim.agreement = std::sqrt(dot(aim.forward, aim.forward));
  if (aim.agreement > 0) {
    for (double& value : aim.forward) value /= aim.agreement;
  }
  return aim;
}

/// Throws Error (bad input) if a camera of an array of pinholes that look one way looks back: the
/// usual cause is another program's axes.
void check_viewing_direction(const JsonNode& matrix, const CameraGeometry& camera,
                             const ArrayAim& aim) {
  const double cosine = dot(viewing_direction(camera), aim.forward);
  if (cosine > 0) return;
  const double degrees = std::acos(std::max(cosine, -1.0)) * 180 / std::numbers::pi;
  throw matrix.input_error(
      fmt::format("the camera \"{}\" looks {:.1f} degrees away from the mean viewing "
                  "direction, allowed for pinholes with a depth range: less than 90",
                  camera.id, degrees),
      "Give poses with y up, looking down -z: negate the second and third column of matrices "
      "of OpenCV or COLMAP (y down, +z forward)");
}

/// Throws Error (bad input) unless the whole depth range is in front of every camera. It is
/// measured from the array's centre: along its mean viewing direction if the cameras look one way,
/// along that of each camera if they look outwards.
void check_depth_range(const JsonNode& document, const ImportManifest& manifest) {
  if (!manifest.depth_range) return;
  const JsonNode cameras = document.at("cameras");
  const ArrayAim aim = aim_of(manifest);
  // The mean direction of half a sphere has the length 0.5; that of a ring or a sphere is shorter.
  constexpr double kOneWay = 0.6, kOutward = 0.5, kNoDirection = 1e-3;
  const bool outward = aim.outward > kOutward && aim.agreement < kOneWay;
  if (!outward && aim.agreement < kNoDirection) {
    throw cameras.input_error(
        "the cameras have no mean viewing direction, so a depth range is undefined",
        "Remove \"depth_range_m\", or correct \"world_from_camera\"");
  }
  for (std::size_t i = 0; i < manifest.cameras.size(); ++i) {
    const CameraGeometry& camera = manifest.cameras[i].geometry;
    const JsonNode matrix = cameras.at(i).at("world_from_camera");
    if (!outward && aim.all_pinholes) check_viewing_direction(matrix, camera, aim);
    const double advance = dot(difference(centre(camera), aim.centre),
                               outward ? viewing_direction(camera) : aim.forward);
    if (advance >= manifest.depth_range->near) {
      throw matrix.input_error(
          fmt::format(
              "the camera \"{}\" is {:.6g} m in front of the array's centre, beyond the near "
              "end of the depth range at {:.6g} m",
              camera.id, advance, manifest.depth_range->near),
          "Correct the position or \"depth_range_m\"");
    }
  }
}

void check_form(const JsonNode& object, const ImportManifest::Camera& camera) {
  const bool movie = object.has("movie");
  if (movie == object.has("frames") || (object.has("times_ns") && !movie)) {
    throw object.input_error(
        fmt::format("the camera \"{}\" has {}\"frames\", {}\"movie\" and {}\"times_ns\", allowed: "
                    "either \"frames\", or \"movie\", with or without \"times_ns\"",
                    camera.geometry.id, object.has("frames") ? "" : "no ", movie ? "" : "no ",
                    object.has("times_ns") ? "" : "no "),
        "Keep one of the two forms");
  }
}

/// Throws Error (bad input) for a time that is not after the previous one.
void check_time(const JsonNode& node, Nanoseconds time, Nanoseconds previous) {
  if (time > previous) return;
  throw node.input_error(
      fmt::format("found {} after {}, allowed: increasing times", time, previous),
      "Sort the frames by time and list each once");
}

constexpr auto kTimes =
    list_of(PlainCodec{}, [](const JsonNode& node, const std::vector<Nanoseconds>& times) {
      check_time(node, times.back(), times.size() > 1 ? times[times.size() - 2] : -1);
    });
constexpr auto kFrames =
    list_of(Fields(required("file", &ImportManifest::Frame::file, kPath),
                   required("time_ns", &ImportManifest::Frame::time_ns)),
            [](const JsonNode& object, const std::vector<ImportManifest::Frame>& frames) {
              check_time(object.at("time_ns"), frames.back().time_ns,
                         frames.size() > 1 ? frames[frames.size() - 2].time_ns : -1);
            });

bool has_frames(const ImportManifest::Camera& camera) { return camera.movie.empty(); }

constexpr Fields kImportCamera(
    kGeometryFields, check(check_form),
    written_if(has_frames, defaulted("frames", &ImportManifest::Camera::frames, kFrames)),
    written_if(std::not_fn(has_frames), defaulted("movie", &ImportManifest::Camera::movie, kPath),
               optional("times_ns", &ImportManifest::Camera::times_ns, kTimes)));

constexpr Fields kImport(required("name", &ImportManifest::name),
                         required("epoch_utc", &ImportManifest::epoch_utc, kUtc),
                         required("nominal_fps", &ImportManifest::nominal_fps),
                         required("color_space", &ImportManifest::color_space),
                         optional("scale", &ImportManifest::arbitrary_scale, kScaleNames),
                         optional("depth_range_m", &ImportManifest::depth_range, kDepthRange),
                         required("cameras", &ImportManifest::cameras,
                                  list_with_ids(kImportCamera)),
                         check(check_depth_range));

}  // namespace

ImportManifest parse_import_manifest(std::string_view text, std::string_view name) {
  return parse_document_as<ImportManifest>("import", kImport, text, name);
}

std::string format_import_manifest(const ImportManifest& manifest) {
  const bool is_plain = std::ranges::all_of(manifest.cameras, [](const auto& camera) {
    return is_plain_camera(camera.geometry) && (camera.movie.empty() || !camera.times_ns.empty());
  });
  return format_document("import", kImport, manifest, is_plain ? 1 : 2);
}

ImportManifest read_import_manifest(const std::filesystem::path& file) {
  return parse_import_manifest(read_file(file), file.string());
}

void write_import_manifest(const ImportManifest& manifest, const std::filesystem::path& file) {
  write_document(format_import_manifest(manifest), parse_import_manifest, file);
}

}  // namespace raystage::schemas
