// SPDX-License-Identifier: Apache-2.0
// Filter footprint and supersampling (thesis 5.3). The footprint is the largest singular value of
// the 2x2 derivative of source pixels by view pixels, at 5x5 positions of the view. Derivatives are
// central differences over one pixel, through the focal plane and the lens. Downsampling averages
// factor x factor pixels. Cost: 25 positions x cameras; one pass over the samples.

#include "render/common/footprint.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <utility>

#include "base/parallel.h"
#include "render/common/plane_projection.h"
#include "render/common/ray_cells.h"

namespace raystage::render {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

/// Returns where the camera sees the point on the plane behind the view's pixel position, if it
/// does.
std::optional<Vector2d> pixel_in(const rig::CameraModel& model, const Matrix3d& ideal_from_pixel,
                                 double x, double y) {
  const Vector3d ideal = ideal_from_pixel * Vector3d(x, y, 1);
  if (!(ideal.z() > 0)) return std::nullopt;
  const auto pixel = model.pixel_from_ideal(ideal.hnormalized());
  return pixel && model.contains(*pixel) ? pixel : std::nullopt;
}

}  // namespace

double source_pixels_per_pixel(const VirtualCamera& view, const LightFieldFrame& instant,
                               const Eigen::Vector4d& plane) {
  constexpr int kPlaces = 5;
  VirtualCamera ideal_view = view;
  ideal_view.intrinsics.distortion = {};
  const PlaneProjection projection(ideal_view, plane);
  if (!projection.at_infinity() && projection.distance() == 0) return 0;
  const auto stretch_in = [&](int index, double x, double y) -> double {
    const rig::Rig::Camera& camera = instant.rig->cameras[index];
    const Matrix3d ideal = projection.ideal_from_pixel(camera.pose);
    const auto left = pixel_in(camera.model, ideal, x - 0.5, y);
    const auto right = pixel_in(camera.model, ideal, x + 0.5, y);
    const auto above = pixel_in(camera.model, ideal, x, y - 0.5);
    const auto below = pixel_in(camera.model, ideal, x, y + 0.5);
    if (!left || !right || !above || !below) return 0;
    Eigen::Matrix2d source_from_view;
    source_from_view << *right - *left, *below - *above;
    const double stretch = source_from_view.jacobiSvd().singularValues()[0];
    return std::isfinite(stretch) ? stretch : 0;
  };
  const auto most_over_places = [&](const auto& stretch_at) {
    double most = 0;
    for (int i = 0; i < kPlaces * kPlaces; ++i) {
      const int column = i % kPlaces, row = i / kPlaces;
      const double x = view.width * (column + 0.5) / kPlaces;
      const double y = view.height * (row + 0.5) / kPlaces;
      if (projection.depth(x, y) > 0) most = std::max(most, stretch_at(x, y));
    }
    return most;
  };
  const RayCells cells(ideal_view, *instant.rig, *instant.present);
  const double between = most_over_places([&](double x, double y) -> double {
    const auto crossing = cells.locate(x, y);
    if (!crossing) return 0;
    const RayCells::Cell& cell = cells.cells()[crossing->cell];
    double most = 0;
    for (int c = 0; c < cell.count; ++c) most = std::max(most, stretch_in(cell.camera[c], x, y));
    return most;
  });
  if (between > 0) return between;
  // If all rays miss the array, the nearest camera that sees the point counts, for methods that
  // sample outside it.
  const Matrix3d ray_from_pixel = world_ray_from_pixel(ideal_view);
  return most_over_places([&](double x, double y) -> double {
    const Vector3d ray = (ray_from_pixel * Vector3d(x, y, 1)).normalized();
    double nearest = std::numeric_limits<double>::infinity(), stretch = 0;
    for (const int camera : instant.included_cameras) {
      if (!instant.is_present(camera)) continue;
      const Vector3d beside = instant.rig->cameras[camera].pose.position - view.pose.position;
      const double distance = (beside - beside.dot(ray) * ray).squaredNorm();
      if (distance >= nearest) continue;
      const double here = stretch_in(camera, x, y);
      if (here > 0) nearest = distance, stretch = here;
    }
    return stretch;
  });
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

RenderedView downsampled(const RenderedView& image, int factor) {
  RenderedView mean;
  mean.width = image.width / factor;
  mean.height = image.height / factor;
  mean.statistics = image.statistics;
  mean.notes = image.notes;
  constexpr std::array kAveraged{&RenderedView::coverage, &RenderedView::cameras,
                                 &RenderedView::empty_space, &RenderedView::confidence};
  const auto pixels = static_cast<std::size_t>(mean.width) * mean.height;
  mean.rgba.resize(pixels * 4);
  mean.z.resize(pixels);
  if (!image.nearest_ray.empty()) mean.nearest_ray.resize(pixels);
  for (const auto plane : kAveraged)
    if (!(image.*plane).empty()) (mean.*plane).resize(pixels);
  const float share = 1.0F / static_cast<float>(factor * factor);
  raystage::parallel_for(0, mean.height, [&](int y) {
    for (int x = 0; x < mean.width; ++x) {
      const std::size_t to = mean.index(x, y);
      const auto for_each_sample = [&](const auto& body) {
        for (int i = 0; i < factor * factor; ++i) {
          body(image.index(x * factor + i % factor, y * factor + i / factor));
        }
      };
      float sum[4] = {0, 0, 0, 0}, inverse_depth = 0;
      for_each_sample([&](std::size_t from) {
        for (std::size_t c = 0; c < 4; ++c) sum[c] += image.rgba[from * 4 + c];
        const float alpha = image.rgba[from * 4 + 3];
        if (alpha > 0) inverse_depth += alpha / image.z[from];
      });
      for (std::size_t c = 0; c < 4; ++c) mean.rgba[to * 4 + c] = sum[c] * share;
      mean.z[to] =
          inverse_depth > 0 ? sum[3] / inverse_depth : std::numeric_limits<float>::infinity();
      for (const auto plane : kAveraged) {
        if ((image.*plane).empty()) continue;
        float total = 0;
        for_each_sample([&](std::size_t from) { total += (image.*plane)[from]; });
        (mean.*plane)[to] = total * share;
      }
      if (image.nearest_ray.empty()) continue;
      float nearest = std::numeric_limits<float>::infinity();
      for_each_sample(
          [&](std::size_t from) { nearest = std::min(nearest, image.nearest_ray[from]); });
      mean.nearest_ray[to] = nearest;
    }
  });
  return mean;
}

VirtualCamera crop_rows(const VirtualCamera& view, int first, int end) {
  VirtualCamera rows = view;
  rows.height = end - first;
  rows.intrinsics.cy -= first;
  return rows;
}

void insert_rows(RenderedView&& rows, int first, int height, RenderedView& whole) {
  whole.width = rows.width;
  whole.height = height;
  const auto put = [&](PixelValues RenderedView::*plane, std::size_t channels) {
    const PixelValues& from = rows.*plane;
    if (from.empty()) return;
    (whole.*plane).resize(whole.index(0, height) * channels);
    std::ranges::copy(from, &(whole.*plane)[whole.index(0, first) * channels]);
  };
  put(&RenderedView::rgba, 4);
  for (const auto plane :
       {&RenderedView::coverage, &RenderedView::z, &RenderedView::cameras,
        &RenderedView::nearest_ray, &RenderedView::empty_space, &RenderedView::confidence}) {
    put(plane, 1);
  }
  whole.statistics.add_part(rows.statistics);
  for (std::string& note : rows.notes) {
    if (std::ranges::count(whole.notes, note) == 0) whole.notes.push_back(std::move(note));
  }
}

}  // namespace raystage::render
