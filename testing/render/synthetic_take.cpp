// SPDX-License-Identifier: Apache-2.0
#include "testing/render/synthetic_take.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/transfer_function.h"
#include "rig/rig.h"
#include "store/take.h"

namespace raystage::testing {

std::array<double, 3> painted_plane(double x, double y) {
  return {0.4 + 0.3 * std::sin(7 * x) * std::cos(5 * y), 0.4 + 0.25 * std::sin(4 * x + 6 * y),
          0.4 + 0.3 * std::cos(6 * x - 3 * y)};
}

std::vector<schemas::CameraGeometry> camera_grid(int rows, int columns, double spacing, int width,
                                                 int height,
                                                 const schemas::Distortion& distortion) {
  std::vector<schemas::CameraGeometry> cameras;
  const double focal_length = width / 2.0 / std::tan(31 * std::numbers::pi / 180);
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      schemas::CameraGeometry camera;
      camera.id = "r" + std::to_string(row) + "c" + std::to_string(column);
      camera.width = width;
      camera.height = height;
      camera.intrinsics = {focal_length, focal_length, width / 2.0, height / 2.0, distortion};
      camera.world_from_camera[3] = (column - (columns - 1) / 2.0) * spacing;
      camera.world_from_camera[7] = ((rows - 1) / 2.0 - row) * spacing;
      camera.row = row;
      camera.column = column;
      cameras.push_back(camera);
    }
  }
  return cameras;
}

namespace {

/// Returns the linear light along the ray of an image position.
std::array<double, 3> light_at(const SyntheticTake& settings, const rig::CameraModel& model,
                               const rig::Pose& pose, double x, double y) {
  const auto ray = model.unproject({x, y});
  if (!ray) return {};
  const Eigen::Vector3d direction = pose.world_from_camera_rotation * *ray;
  if (settings.scene) return settings.scene(pose.position, direction);
  const double t = (-settings.plane_depth - pose.position.z()) / direction.z();
  const Eigen::Vector3d hit = pose.position + t * direction;
  return painted_plane(hit.x(), hit.y());
}

}  // namespace

store::RgbImage render_camera_image(const schemas::CameraGeometry& geometry,
                                    const SyntheticTake& settings) {
  const rig::CameraModel model(geometry);
  const rig::Pose pose = rig::pose_from_matrix(geometry.world_from_camera);
  const int parts = settings.samples;
  store::RgbImage image{geometry.width, geometry.height, std::vector<std::uint8_t>()};
  for (int y = 0; y < geometry.height; ++y) {
    for (int x = 0; x < geometry.width; ++x) {
      std::array<double, 3> linear{};
      for (int i = 0; i < parts * parts; ++i) {
        const int column = i % parts, row = i / parts;
        const auto light =
            light_at(settings, model, pose, x + (column + 0.5) / parts, y + (row + 0.5) / parts);
        for (std::size_t c = 0; c < 3; ++c) linear[c] += light[c] / (parts * parts);
      }
      for (std::size_t c = 0; c < 3; ++c) {
        const schemas::PhotometricResponse& response = settings.photometric;
        const double shown = (linear[c] - response.brightness[c]) / response.contrast[c];
        const double code = std::clamp(srgb_from_linear(shown), 0.0, 1.0);
        image.values.push_back(static_cast<std::uint8_t>(code * 255 + 0.5));
      }
    }
  }
  return image;
}

void write_synthetic_take(const SyntheticTake& settings, const std::filesystem::path& folder) {
  schemas::TakeDocument take;
  take.name = "synthetic";
  take.created_by = "raystage test";
  take.nominal_fps = 15;
  take.color_space = "srgb_texture";
  take.clock = "simulated";
  take.timestamp_event = "exposure_middle";
  if (settings.has_depth_range) {
    take.depth_range = settings.depth_range.value_or(
        schemas::DepthRange{settings.plane_depth, settings.plane_depth * 1.001});
    if (take.depth_range->near == 0) take.depth_range.reset();
  }
  schemas::RigDocument rig;
  rig.name = "synthetic";
  for (const schemas::CameraGeometry& camera : settings.cameras) {
    take.cameras.push_back({camera.id, "", "", ""});
    rig.cameras.push_back({camera, settings.photometric});
    for (std::size_t axis = 0; axis < 3; ++axis) {
      rig.cameras.back().geometry.world_from_camera[4 * axis + 3] += settings.origin[axis];
    }
  }
  store::TakeWriter writer(folder, take, rig);
  for (std::size_t i = 0; i < settings.cameras.size(); ++i) {
    const int camera = static_cast<int>(i);
    const auto jpeg =
        store::encode_jpeg(render_camera_image(settings.cameras[i], settings), settings.jpeg);
    for (int frame = 0; frame < settings.frames; ++frame) {
      const Nanoseconds time = frame * kNanosecondsPerSecond / 15;
      const bool dropped = std::find(settings.absent.begin(), settings.absent.end(),
                                     std::pair{camera, frame}) != settings.absent.end();
      if (dropped) {
        writer.archive(camera).append_missing(store::FrameStatus::kDroppedBySource, time);
      } else {
        writer.archive(camera).append(jpeg, time);
      }
    }
  }
  writer.commit();
}

}  // namespace raystage::testing
