// SPDX-License-Identifier: Apache-2.0
#include "render/common/view.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "base/parallel.h"

namespace raystage::render {

VirtualCamera virtual_camera_from_geometry(const schemas::CameraGeometry& geometry) {
  return {geometry.width, geometry.height, geometry.intrinsics,
          rig::pose_from_matrix(geometry.world_from_camera)};
}

VirtualCamera virtual_camera_with_fov(int width, int height, double horizontal_fov,
                                      const rig::Pose& pose) {
  const double focal_length = width / (2 * std::tan(horizontal_fov / 2));
  return {width, height, {focal_length, focal_length, width / 2.0, height / 2.0, {}}, pose};
}

VirtualCamera equirectangular_camera(int width, int height, const rig::Pose& pose,
                                     double eye_offset) {
  VirtualCamera camera{width, height, {}, pose};
  camera.is_equirectangular = true;
  camera.eye_offset = eye_offset;
  return camera;
}

WorldRay pixel_ray(const VirtualCamera& camera, double x, double y) {
  const rig::Pose& pose = camera.pose;
  if (!camera.is_equirectangular) {
    const schemas::Intrinsics& k = camera.intrinsics;
    const Eigen::Vector3d ahead((x - k.cx) / k.fx, (k.cy - y) / k.fy, -1);
    return {pose.position, (pose.world_from_camera_rotation * ahead).normalized()};
  }
  const double longitude = (x / camera.width - 0.5) * 2 * std::numbers::pi;
  const double latitude = (0.5 - y / camera.height) * std::numbers::pi;
  const double level = std::cos(latitude);
  const Eigen::Vector3d direction(level * std::sin(longitude), std::sin(latitude),
                                  -level * std::cos(longitude));
  const Eigen::Vector3d right(std::cos(longitude), 0, std::sin(longitude));
  return {pose.world_from_camera(camera.eye_offset * right),
          pose.world_from_camera_rotation * direction};
}

Eigen::Vector3d point_at_depth(const VirtualCamera& camera, double x, double y, double depth) {
  if (camera.is_equirectangular) {
    const WorldRay ray = pixel_ray(camera, x, y);
    return ray.origin + depth * ray.direction;
  }
  const schemas::Intrinsics& k = camera.intrinsics;
  const Eigen::Vector3d ahead((x - k.cx) / k.fx, (k.cy - y) / k.fy, -1);
  return camera.pose.world_from_camera(ahead * depth);
}

double depth_of(const VirtualCamera& camera, const WorldRay& ray, double distance) {
  if (camera.is_equirectangular) return distance;
  return -distance * ray.direction.dot(camera.pose.world_from_camera_rotation.col(2));
}

double pixel_angle(const VirtualCamera& camera) {
  return camera.is_equirectangular ? 2 * std::numbers::pi / camera.width : 1 / camera.intrinsics.fx;
}

VirtualCamera undistorted(const rig::CameraModel& model, const rig::Pose& pose) {
  if (const rig::Facet* facet = model.facet()) {
    const double focal = facet->focal_length;
    const double left = std::floor(facet->left * focal), top = std::floor(facet->top * focal);
    const double right = std::ceil(facet->right * focal), bottom = std::ceil(facet->bottom * focal);
    return {static_cast<int>(right - left),
            static_cast<int>(bottom - top),
            {focal, focal, -left, -top, {}},
            pose};
  }
  VirtualCamera pinhole{model.width(), model.height(), model.intrinsics(), pose};
  if (!model.has_distortion()) return pinhole;
  if (const rig::FisheyeLens* lens = model.fisheye()) {
    // As many pixels per radian as in the middle of the frame.
    for (double* focal : {&pinhole.intrinsics.fx, &pinhole.intrinsics.fy}) *focal *= lens->slope(0);
    pinhole.intrinsics.projection = schemas::Projection::kPinhole;
    pinhole.intrinsics.radial_distortion = {};
    pinhole.intrinsics.half_angle = std::nullopt;
  }
  pinhole.intrinsics.distortion = {};
  const schemas::Intrinsics& k = pinhole.intrinsics;
  double left = 0, right = model.width(), top = 0, bottom = model.height();
  constexpr int kParts = 32;  // positions per side of the frame's border
  for (int i = 0; i <= kParts; ++i) {
    const double along_x = model.width() * static_cast<double>(i) / kParts;
    const double along_y = model.height() * static_cast<double>(i) / kParts;
    for (const Eigen::Vector2d& pixel :
         {Eigen::Vector2d(along_x, 0), Eigen::Vector2d(along_x, model.height()),
          Eigen::Vector2d(0, along_y), Eigen::Vector2d(model.width(), along_y)}) {
      const auto ideal = model.ideal_from_pixel(pixel);
      if (!ideal) continue;
      left = std::min(left, k.fx * ideal->x() + k.cx);
      right = std::max(right, k.fx * ideal->x() + k.cx);
      top = std::min(top, k.fy * ideal->y() + k.cy);
      bottom = std::max(bottom, k.fy * ideal->y() + k.cy);
    }
  }
  const auto grown = [](double from, double to, int size) {
    const double half = size / 2.0;  // at most half a frame more on each side
    return std::pair(std::floor(std::max(from, -half)), std::ceil(std::min(to, size + half)));
  };
  const auto [x0, x1] = grown(left, right, model.width());
  const auto [y0, y1] = grown(top, bottom, model.height());
  pinhole.width = static_cast<int>(x1 - x0);
  pinhole.height = static_cast<int>(y1 - y0);
  pinhole.intrinsics.cx -= x0;
  pinhole.intrinsics.cy -= y0;
  return pinhole;
}

void RenderStatistics::add_part(const RenderStatistics& part) {
  plan_ms += part.plan_ms;
  decode_ms += part.decode_ms;
  render_ms += part.render_ms;
  pixels_decoded += part.pixels_decoded;
  pixels_needed += part.pixels_needed;
  cameras_used = std::max(cameras_used, part.cameras_used);
  working_bytes = std::max(working_bytes, part.working_bytes);
}

std::size_t view_buffer_bytes(const VirtualCamera& view) {
  return static_cast<std::size_t>(view.width) * view.height * 6 * sizeof(float);
}

RenderedView empty_view(const VirtualCamera& view) {
  RenderedView image = uninitialised_view(view);
  // In parallel, because the first write to each page of new memory is slow.
  constexpr int kRowsPerTask = 64;
  const auto width = static_cast<std::ptrdiff_t>(view.width);
  raystage::parallel_for(tbb::blocked_range<int>(0, view.height, kRowsPerTask),
                         [&](const tbb::blocked_range<int>& rows) {
                           const auto fill = [&](PixelValues& values, std::ptrdiff_t channels,
                                                 float value) {
                             std::fill(values.begin() + rows.begin() * width * channels,
                                       values.begin() + rows.end() * width * channels, value);
                           };
                           fill(image.rgba, 4, 0.0F);
                           fill(image.coverage, 1, 0.0F);
                           fill(image.z, 1, std::numeric_limits<float>::infinity());
                         });
  return image;
}

RenderedView uninitialised_view(const VirtualCamera& view, PixelValues rgba) {
  RenderedView image;
  image.width = view.width;
  image.height = view.height;
  image.rgba = std::move(rgba);
  image.rgba.resize(view_value_count(view));
  image.coverage.resize(image.rgba.size() / 4);
  image.z.resize(image.rgba.size() / 4);
  return image;
}

void clear_coverage_measures(RenderedView& image) {
  image.cameras.assign(image.coverage.size(), 0.0F);
  image.nearest_ray.assign(image.coverage.size(), std::numeric_limits<float>::infinity());
}

void add_notes(const std::vector<std::string>& notes, std::vector<std::string>& to) {
  for (const std::string& note : notes) {
    if (std::ranges::find(to, note) == to.end()) to.push_back(note);
  }
}

std::size_t view_value_count(const VirtualCamera& view) {
  return static_cast<std::size_t>(view.width) * view.height * 4;
}

}  // namespace raystage::render
