// SPDX-License-Identifier: Apache-2.0
// Reads the camera of a .chan or glTF file as functions of the shot's frame. A line of a .chan file
// names its frame. A time of a glTF file is in seconds, so that the frame rate decides its frame;
// a wrong rate shows as keys between frames. Output: world coordinates, metres; focal lengths in
// half image widths. Cost: linear in the file's keys, then O(log n) per frame.
#include "compose/camera/camera_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "base/atomic_file.h"
#include "base/error.h"
#include "base/frame_rate.h"
#include "compose/camera/chan_file.h"
#include "compose/camera/gltf_camera.h"

namespace raystage::compose {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;
using schemas::ShotDocument;

/// Returns the focal length in half image widths from a vertical field of view (radians).
double focal_from_vertical(double fov, double height_by_width) {
  return height_by_width / std::tan(fov / 2);
}

std::string frame_range_text(double first, double last) {
  return first == last ? fmt::format("frame {:.10g}", first)
                       : fmt::format("frames {:.10g} to {:.10g}", first, last);
}

/// Throws Error (bad input) if the camera moves, but not during the shot.
void check_overlap(const ShotDocument& shot, double first, double last,
                   const std::filesystem::path& file, const std::string& where) {
  if (first == last || (first <= shot.last_frame && last >= shot.first_frame)) return;
  throw Error::bad_input(
      fmt::format("the keys of {} are at {}, none of the shot's frames {} to {}", file.string(),
                  frame_range_text(first, last), shot.first_frame, shot.last_frame),
      where + "/file", "Correct the shot's frames, or frame_offset or fps of the camera file");
}

ImportedCamera import_chan(const ShotDocument& shot, const std::filesystem::path& file,
                           const std::string& where) {
  const ShotDocument::CameraFile& source = *shot.camera.file;
  const RotationOrder order =
      parse_rotation_order(source.rotation_order).value_or(RotationOrder::kZxy);
  const double film_back_mm = shot.camera.film_back_mm;
  const double height_mm =
      source.film_back_height_mm.value_or(film_back_mm * shot.height / shot.width);
  std::vector<CurveKey<Vector3d>> positions;
  std::vector<CurveKey<Quaterniond>> orientations;
  std::vector<CurveKey<double>> focals;
  for (const ChanLine& line : parse_chan(read_file(file), order, file.string())) {
    const double frame = line.frame + source.frame_offset;
    positions.push_back({frame, line.position});
    orientations.push_back({frame, line.orientation});
    if (line.vertical_fov) {
      focals.push_back({frame, focal_from_vertical(*line.vertical_fov, height_mm / film_back_mm)});
    }
  }
  const double first = positions.front().frame, last = positions.back().frame;
  check_overlap(shot, first, last, file, where);
  ImportedCamera camera;
  camera.channels.position = Curve<Vector3d>(positions);
  camera.channels.orientation = RotationCurve(orientations);
  camera.summary = fmt::format("{}, {}", file.string(), frame_range_text(first, last));
  if (!focals.empty()) {
    camera.channels.focal = Curve<double>(focals);
    camera.summary += fmt::format(", vertical field of view of a film back of {:.6g} x {:.6g} mm",
                                  film_back_mm, height_mm);
  }
  return camera;
}

ImportedCamera import_gltf(const ShotDocument& shot, const std::filesystem::path& file,
                           const std::string& where) {
  const ShotDocument::CameraFile& source = *shot.camera.file;
  const GltfFrameRate rate{source.fps, {shot.fps_numerator, shot.fps_denominator}};
  const auto gltf =
      std::make_shared<const GltfCamera>(read_gltf_camera(file, source.camera_name, rate));
  GltfFrames frames =
      gltf_frames(gltf->timing, gltf->key_seconds, file, where + "/file",
                  "Add the rate of the program that wrote the file as fps of the camera file");
  frames.zero += source.frame_offset;
  ImportedCamera camera;
  camera.summary = fmt::format("{}, camera \"{}\"", file.string(), gltf->name);
  if (gltf->key_seconds.empty()) {
    camera.summary += ", not animated";
  } else {
    const double first = frames.frame(gltf->key_seconds.front()),
                 last = frames.frame(gltf->key_seconds.back());
    check_overlap(shot, first, last, file, where);
    camera.summary += fmt::format(", {} at {:.10g} fps", frame_range_text(first, last), frames.fps);
  }
  const double height_by_width = static_cast<double>(shot.height) / shot.width;
  camera.focal_is_animated = gltf->fov_is_animated;
  camera.channels.position = [=](double frame) {
    return gltf->pose(frames.seconds(frame)).position;
  };
  camera.channels.orientation = [=](double frame) {
    return Quaterniond(gltf->pose(frames.seconds(frame)).world_from_camera_rotation);
  };
  camera.channels.focal = [=](double frame) {
    return focal_from_vertical(gltf->vertical_fov(frames.seconds(frame)), height_by_width);
  };
  return camera;
}

}  // namespace

ImportedCamera import_camera(const ShotDocument& shot, const std::filesystem::path& file,
                             const std::string& where) {
  return file.extension() == ".chan" ? import_chan(shot, file, where)
                                     : import_gltf(shot, file, where);
}

}  // namespace raystage::compose
