// SPDX-License-Identifier: Apache-2.0
#include "render/view/footprint.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "render/view/plane_projection.h"
#include "render/view/ray_cells.h"
#include "schemas/parallel.h"

namespace raystage {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

/// Where the camera sees what lies on the plane behind the view's pixel position, if it does.
std::optional<Vector2d> pixel_in(const CameraModel& model, const Matrix3d& ideal_from_pixel,
                                 double x, double y) {
  const Vector3d ideal = ideal_from_pixel * Vector3d(x, y, 1);
  if (!(ideal.z() > 0)) return std::nullopt;
  const auto pixel = model.pixel_from_ideal(ideal.hnormalized());
  return pixel && model.contains(*pixel) ? pixel : std::nullopt;
}

}  // namespace

double source_pixels_per_pixel(const VirtualCamera& view, const Instant& instant,
                               const Eigen::Vector4d& plane) {
  constexpr int kPlaces = 5;
  VirtualCamera ideal_view = view;
  ideal_view.intrinsics.distortion = {};
  const PlaneProjection projection(ideal_view, plane);
  if (!projection.at_infinity() && projection.distance() == 0) return 0;
  const RayCells cells(ideal_view, *instant.rig, *instant.present);
  double most = 0;
  for (int i = 0; i < kPlaces * kPlaces; ++i) {
    const double x = view.width * (i % kPlaces + 0.5) / kPlaces;
    const double y = view.height * (i / kPlaces + 0.5) / kPlaces;
    const auto crossing = cells.locate(x, y);
    if (!crossing || !(projection.depth(x, y) > 0)) continue;
    const RayCells::Cell& cell = cells.cells()[static_cast<std::size_t>(crossing->cell)];
    for (std::size_t c = 0; c < static_cast<std::size_t>(cell.count); ++c) {
      const Rig::Camera& camera = instant.rig->cameras[static_cast<std::size_t>(cell.camera[c])];
      const Matrix3d ideal = projection.ideal_from_pixel(camera.pose);
      const auto left = pixel_in(camera.model, ideal, x - 0.5, y);
      const auto right = pixel_in(camera.model, ideal, x + 0.5, y);
      const auto above = pixel_in(camera.model, ideal, x, y - 0.5);
      const auto below = pixel_in(camera.model, ideal, x, y + 0.5);
      if (!left || !right || !above || !below) continue;
      Eigen::Matrix2d source_from_view;
      source_from_view << *right - *left, *below - *above;
      const double stretch = source_from_view.jacobiSvd().singularValues()[0];
      if (std::isfinite(stretch)) most = std::max(most, stretch);
    }
  }
  return most;
}

VirtualCamera supersampled(const VirtualCamera& view, int factor) {
  VirtualCamera fine = view;
  fine.width *= factor;
  fine.height *= factor;
  fine.intrinsics.fx *= factor;
  fine.intrinsics.fy *= factor;
  fine.intrinsics.cx *= factor;
  fine.intrinsics.cy *= factor;
  return fine;
}

namespace {

/// The cameras' mean, by alpha; the nearest ray of all.
void average_measures(const RenderedView& image, int factor, int x, int y, std::size_t to,
                      RenderedView& mean) {
  float cameras = 0, alpha = 0, nearest = std::numeric_limits<float>::infinity();
  for (int i = 0; i < factor * factor; ++i) {
    const auto row = static_cast<std::size_t>(y * factor + i / factor);
    const std::size_t from = row * static_cast<std::size_t>(image.width) +
                             static_cast<std::size_t>(x * factor + i % factor);
    alpha += image.rgba[from * 4 + 3];
    cameras += image.rgba[from * 4 + 3] * image.cameras[from];
    nearest = std::min(nearest, image.nearest_ray[from]);
  }
  mean.cameras[to] = alpha > 0 ? cameras / alpha : 0;
  mean.nearest_ray[to] = nearest;
}

}  // namespace

RenderedView averaged(const RenderedView& image, int factor) {
  RenderedView mean;
  mean.width = image.width / factor;
  mean.height = image.height / factor;
  mean.statistics = image.statistics;
  mean.notes = image.notes;
  const auto pixels = static_cast<std::size_t>(mean.width) * static_cast<std::size_t>(mean.height);
  mean.rgba.resize(pixels * 4);
  mean.coverage.resize(pixels);
  mean.z.resize(pixels);
  mean.cameras.resize(image.cameras.empty() ? 0 : pixels);
  mean.nearest_ray.resize(image.nearest_ray.empty() ? 0 : pixels);
  const float share = 1.0F / static_cast<float>(factor * factor);
  raystage::parallel_for(0, mean.height, [&](int y) {
    for (int x = 0; x < mean.width; ++x) {
      float sum[4] = {0, 0, 0, 0}, coverage = 0, inverse_depth = 0;
      for (int i = 0; i < factor * factor; ++i) {
        const auto row = static_cast<std::size_t>(y * factor + i / factor);
        const std::size_t from = row * static_cast<std::size_t>(image.width) +
                                 static_cast<std::size_t>(x * factor + i % factor);
        for (std::size_t c = 0; c < 4; ++c) sum[c] += image.rgba[from * 4 + c];
        coverage += image.coverage[from];
        if (const float alpha = image.rgba[from * 4 + 3]; alpha > 0) {
          inverse_depth += alpha / image.z[from];
        }
      }
      const std::size_t to = static_cast<std::size_t>(y) * static_cast<std::size_t>(mean.width) +
                             static_cast<std::size_t>(x);
      for (std::size_t c = 0; c < 4; ++c) mean.rgba[to * 4 + c] = sum[c] * share;
      mean.coverage[to] = coverage * share;
      mean.z[to] =
          inverse_depth > 0 ? sum[3] / inverse_depth : std::numeric_limits<float>::infinity();
      if (!mean.cameras.empty()) average_measures(image, factor, x, y, to, mean);
    }
  });
  return mean;
}

}  // namespace raystage
