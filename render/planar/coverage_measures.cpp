// SPDX-License-Identifier: Apache-2.0
// Measures the cameras behind each visible pixel of a view of focal_plane, nearest or aperture.
// Locates the cell that the ray crosses and adds its cameras by weight times visibility of the
// ray's point (RayCoverage), in double. Input: alpha and z (metres) of the view. Output: effective
// number of cameras, (sum w)^2 / sum w^2, and distance of the nearest one from the ray, metres.
// Cost: O(pixels x 3), for aperture O(pixels x cameras).
#include "render/planar/coverage_measures.h"

#include <Eigen/Geometry>

#include "base/parallel.h"
#include "render/common/ray_cells.h"
#include "render/common/ray_coverage.h"
#include "render/sampling/direction_visibility.h"

namespace raystage::render {
namespace {

using Eigen::Vector3d;

/// A ray of a view with the point that the view shows.
struct ViewRay {
  RayCells::Crossing crossing;
  Vector3d direction;    ///< world, planar depth 1
  double inverse_depth;  ///< per metre
};

/// Calls measure(cells, ray, coverage), which adds cameras, for every visible pixel in parallel.
template <class Measure>
void for_each_ray(const ViewRequest& request, const Measure& measure, RenderedView& image) {
  clear_coverage_measures(image);
  const VirtualCamera& view = request.view;
  VirtualCamera ideal_view = view;
  ideal_view.intrinsics.distortion = {};
  const RayCells cells(ideal_view, *request.instant.rig, *request.instant.present);
  const rig::CameraModel view_model({"view", view.width, view.height, view.intrinsics, {}, {}, {}});
  const auto measure_pixel = [&](int x, int y, std::size_t at) {
    const auto in_view = view_model.unproject({x + 0.5, y + 0.5});
    if (!in_view || !(image.rgba[at * 4 + 3] > 0)) return;
    const schemas::Intrinsics& k = view.intrinsics;
    const auto crossing = cells.locate(in_view->x() * k.fx + k.cx, -in_view->y() * k.fy + k.cy);
    if (!crossing) return;
    RayCoverage coverage;
    measure(cells,
            {*crossing, view.pose.world_from_camera_rotation * *in_view,
             1 / static_cast<double>(image.z[at])},
            coverage);
    image.cameras[at] = coverage.cameras();
    image.nearest_ray[at] = coverage.nearest_ray();
  };
  raystage::parallel_for(0, view.height, [&](int y) {
    for (int x = 0; x < view.width; ++x) measure_pixel(x, y, image.index(x, y));
  });
}

/// Adds a camera by its weight times its visibility of the ray's point.
void add_camera(const ViewRequest& request, const ViewRay& ray, std::size_t camera, double weight,
                RayCoverage& coverage) {
  const rig::Rig::Camera& source = request.instant.rig->cameras[camera];
  const Vector3d to_camera = source.pose.position - request.view.pose.position;
  Eigen::Vector2d pixel;
  const double seen = direction_visibility(source.model,
                                           source.pose.world_from_camera_rotation.transpose() *
                                               (ray.direction - to_camera * ray.inverse_depth),
                                           pixel);
  coverage.add(weight * seen, ray.direction, to_camera);
}

}  // namespace

void measure_planar_coverage(const ViewRequest& request, CornerWeights weights,
                             RenderedView& image) {
  for_each_ray(
      request,
      [&](const RayCells& cells, const ViewRay& ray, RayCoverage& coverage) {
        const RayCells::Crossing crossing =
            weights == CornerWeights::kNearest ? cells.nearest(ray.crossing) : ray.crossing;
        const RayCells::Cell& cell = cells.cells()[crossing.cell];
        for (int i = 0; i < cell.count; ++i) {
          add_camera(request, ray, static_cast<std::size_t>(cell.camera[i]), crossing.weight[i],
                     coverage);
        }
      },
      image);
}

void measure_aperture_coverage(const ViewRequest& request, const ApertureLens& lens,
                               RenderedView& image) {
  for_each_ray(
      request,
      [&](const RayCells& cells, const ViewRay& ray, RayCoverage& coverage) {
        const RayCells::Cell& cell = cells.cells()[ray.crossing.cell];
        const ApertureLens::Plane plane = lens.plane_of(cell);
        const Eigen::Vector2d place = lens.place_of(cell, plane, ray.crossing);
        for (const int camera : request.instant.included_cameras) {
          if (!request.instant.is_present(camera)) continue;
          const auto i = static_cast<std::size_t>(camera);
          const double weight = lens.weight(lens.cameras()[i], plane, place);
          if (weight > 0) add_camera(request, ray, i, weight, coverage);
        }
      },
      image);
}

}  // namespace raystage::render
