// SPDX-License-Identifier: Apache-2.0
// Epipolar-plane images of a row of cameras. Cost: the whole frames of the row are decoded once per
// image; a row of pixels of each is copied.
#include "replay/epipolar_image.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "base/parallel.h"
#include "images/resize.h"

namespace raystage::replay {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

Vector3d axis_of(const render::VirtualCamera& view, int axis) {
  return view.pose.world_from_camera_rotation.col(axis);
}

double median_spacing(const rig::Rig& rig) {
  std::vector<double> nearest;
  for (std::size_t i = 0; i < rig.cameras.size(); ++i) {
    double best = std::numeric_limits<double>::infinity();
    for (std::size_t j = 0; j < rig.cameras.size(); ++j) {
      if (i == j) continue;
      best = std::min(best, (rig.cameras[i].pose.position - rig.cameras[j].pose.position).norm());
    }
    nearest.push_back(best);
  }
  const auto middle = nearest.begin() + static_cast<std::ptrdiff_t>(nearest.size() / 2);
  std::nth_element(nearest.begin(), middle, nearest.end());
  return *middle;
}

/// Returns the row of pixels of a camera that shows a point, clamped to its frame.
int row_of_point(const rig::Rig::Camera& camera, const Vector3d& point) {
  const auto seen = camera.model.project(camera.pose.camera_from_world(point));
  const double y = seen ? std::floor(seen->y()) : camera.model.height() / 2.0;
  return static_cast<int>(std::clamp(y, 0.0, camera.model.height() - 1.0));
}

/// A point between the cameras of a row: position among them, 0 for the first.
std::optional<double> position_among(const rig::Rig& rig, const std::vector<int>& row,
                                     const Vector3d& along, const Vector3d& point) {
  for (std::size_t i = 0; i + 1 < row.size(); ++i) {
    const double left = along.dot(rig.cameras[row[i]].pose.position);
    const double right = along.dot(rig.cameras[row[i + 1]].pose.position);
    const double here = along.dot(point);
    if (here >= left && here <= right && right > left) {
      return static_cast<double>(i) + (here - left) / (right - left);
    }
  }
  return std::nullopt;
}

/// Returns the ray through a pixel, in the world, for a planar depth of 1.
Vector3d ray_through(const render::VirtualCamera& view, const Vector2d& pixel) {
  const schemas::Intrinsics& lens = view.intrinsics;
  return view.pose.world_from_camera_rotation *
         Vector3d((pixel.x() - lens.cx) / lens.fx, -(pixel.y() - lens.cy) / lens.fy, -1);
}

/// Computes EpipolarImage::view_line for lines of `line_height` pixels per camera.
std::vector<std::array<double, 2>> view_line(const rig::Rig& rig, const std::vector<int>& row,
                                             const render::VirtualCamera& view, double pixel_row,
                                             PictureSize size) {
  constexpr int kSamples = 64;
  std::vector<std::array<double, 2>> line;
  const Vector3d along = axis_of(view, 0), normal = rig.mean_viewing_direction();
  Vector3d centre = Vector3d::Zero();
  for (const int camera : row) centre += rig.cameras[camera].pose.position;
  centre /= static_cast<double>(row.size());
  for (int i = 0; i <= kSamples; ++i) {
    const Vector3d ray =
        ray_through(view, {static_cast<double>(i) * view.width / kSamples, pixel_row});
    const double slope = normal.dot(ray);
    if (slope < 1e-6) continue;
    // The ray's point on the plane of the cameras, which may be behind the virtual camera.
    const Vector3d crossing =
        view.pose.position + ray * (normal.dot(centre - view.pose.position) / slope);
    const auto position = position_among(rig, row, along, crossing);
    if (!position) continue;
    const rig::Rig::Camera& nearest = rig.cameras[row[std::lround(*position)]];
    // A camera at the crossing would see the ray as a point at infinity in its direction.
    const auto seen =
        nearest.model.project(nearest.pose.world_from_camera_rotation.transpose() * ray);
    if (!seen || seen->x() < 0 || seen->x() > nearest.model.width()) continue;
    line.push_back({seen->x() / nearest.model.width() * size.width,
                    (*position + 0.5) / static_cast<double>(row.size()) * size.height});
  }
  return line;
}

/// Throws Error (bad input) unless epipolar lines are rows of pixels.
void check_lines_are_rows(const SourceFrames& source, const std::vector<int>& row) {
  constexpr double kLeastCosine = 0.5;  // 60 degrees
  const rig::Rig& rig = source.take.rig();
  for (const int index : row) {
    const rig::Rig::Camera& camera = rig.cameras[index];
    const bool is_pinhole = camera.model.intrinsics().projection == schemas::Projection::kPinhole;
    const bool is_alongside =
        camera.pose.world_from_camera_rotation.col(2).dot(
            rig.cameras[row.front()].pose.world_from_camera_rotation.col(2)) >= kLeastCosine;
    if (is_pinhole && is_alongside) continue;
    throw Error::bad_input(
        "camera \"" + camera.id + "\" " +
            (is_pinhole ? "looks in another direction than its row" : "has a fisheye lens") +
            ": epipolar lines are not rows of its pixels",
        source.take.folder().string(), "Render a view instead");
  }
}

}  // namespace

std::vector<int> camera_row_near(const rig::Rig& rig, const render::VirtualCamera& view) {
  const Vector3d up = axis_of(view, 1), right = axis_of(view, 0);
  const auto height = [&](int camera) {
    return std::abs(up.dot(rig.cameras[camera].pose.position - view.pose.position));
  };
  int nearest = 0;
  for (int i = 0; i < static_cast<int>(rig.cameras.size()); ++i) {
    if (height(i) < height(nearest)) nearest = i;
  }
  const rig::Rig::Camera& chosen = rig.cameras[nearest];
  const double tolerance = rig.cameras.size() > 1 ? median_spacing(rig) / 2 : 0;
  std::vector<int> row;
  for (int i = 0; i < static_cast<int>(rig.cameras.size()); ++i) {
    const rig::Rig::Camera& camera = rig.cameras[i];
    const bool is_in_row =
        chosen.row && camera.row
            ? *camera.row == *chosen.row
            : std::abs(up.dot(camera.pose.position - chosen.pose.position)) <= tolerance;
    if (is_in_row) row.push_back(i);
  }
  std::ranges::sort(row, {}, [&](int i) { return right.dot(rig.cameras[i].pose.position); });
  return row;
}

EpipolarImage make_epipolar_image(const SourceFrames& source, const render::VirtualCamera& view,
                                  const Vector2d& pixel, double focus_m, PictureSize size) {
  const rig::Rig& rig = source.take.rig();
  std::vector<int> row = camera_row_near(rig, view);
  std::erase_if(row, [&](int camera) {
    const int frame = source.frames.frame[camera];
    return frame < 0 || source.take.archive(camera).is_rotten(frame);
  });
  if (row.empty()) {
    throw Error::bad_input("no camera of this row has a frame", source.take.folder().string(),
                           "Choose another frame");
  }
  check_lines_are_rows(source, row);
  const Vector3d point = view.pose.position + ray_through(view, pixel) * focus_m;
  EpipolarImage image;
  // A line of pixels per camera, enlarged afterwards.
  std::vector<store::RgbImage> lines(row.size());
  parallel_for(std::size_t{0}, row.size(), [&](std::size_t i) {
    const rig::Rig::Camera& camera = rig.cameras[row[i]];
    const store::RgbImage frame = decode_source_frame(source, row[i], 1);
    const auto pixels = frame.row(row_of_point(camera, point));
    lines[i] = images::resize(store::RgbImage(frame.width, 1, {pixels.begin(), pixels.end()}),
                              size.width, 1);
  });
  image.picture = store::RgbImage(size.width, size.height);
  const auto count = static_cast<int>(row.size());
  for (int y = 0; y < size.height; ++y) {
    const auto pixels = lines[static_cast<std::size_t>(y) * count / size.height].row(0);
    std::ranges::copy(pixels, image.picture.row(y).begin());
  }
  for (const int index : row) {
    const rig::Rig::Camera& camera = rig.cameras[index];
    image.camera_ids.push_back(camera.id);
    const auto seen = camera.model.project(camera.pose.camera_from_world(point));
    const bool is_inside = seen && seen->x() >= 0 && seen->x() <= camera.model.width();
    image.focus_columns.push_back(
        is_inside ? std::optional(seen->x() / camera.model.width() * size.width) : std::nullopt);
  }
  image.view_line = view_line(rig, row, view, pixel.y(), size);
  return image;
}

}  // namespace raystage::replay
