// SPDX-License-Identifier: Apache-2.0
#include "render/planar/coverage_measures.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <limits>

#include "render/sampling/sight.h"
#include "render/view/ray_cells.h"
#include "schemas/parallel.h"

namespace raystage {

void measure_planar_coverage(const ViewRequest& request, CornerWeights weights,
                             RenderedView& image) {
  image.cameras.assign(image.coverage.size(), 0.0F);
  image.nearest_ray.assign(image.coverage.size(), std::numeric_limits<float>::infinity());
  const VirtualCamera& view = request.view;
  const Rig& rig = *request.instant.rig;
  VirtualCamera ideal_view = view;
  ideal_view.intrinsics.distortion = {};
  const CameraModel view_model({"view", view.width, view.height, view.intrinsics, {}, {}, {}});
  const RayCells cells(ideal_view, rig, *request.instant.present);

  const auto measure = [&](int x, int y, std::size_t at) {
    const auto in_view = view_model.unproject({x + 0.5, y + 0.5});
    if (!in_view || !(image.rgba[at * 4 + 3] > 0)) return;
    const Intrinsics& k = view.intrinsics;
    auto crossing = cells.locate(in_view->x() * k.fx + k.cx, -in_view->y() * k.fy + k.cy);
    if (!crossing) return;
    if (weights == CornerWeights::kNearest) crossing = cells.nearest(*crossing);
    const RayCells::Cell& cell = cells.cells()[static_cast<std::size_t>(crossing->cell)];
    const Eigen::Vector3d ray = view.pose.world_from_camera_rotation * *in_view;
    const double inverse_depth = 1 / static_cast<double>(image.z[at]);
    double sum = 0, squares = 0, nearest = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < static_cast<std::size_t>(cell.count); ++i) {
      const Rig::Camera& camera = rig.cameras[static_cast<std::size_t>(cell.camera[i])];
      const Eigen::Vector3d to_camera = camera.pose.position - view.pose.position;
      Eigen::Vector2d pixel;
      const double weight =
          crossing->weight[i] * seen_along(camera.model,
                                           camera.pose.world_from_camera_rotation.transpose() *
                                               (ray - to_camera * inverse_depth),
                                           pixel);
      if (!(weight > 0)) continue;
      sum += weight;
      squares += weight * weight;
      nearest = std::min(nearest, to_camera.cross(ray).norm() / ray.norm());
    }
    if (!(squares > 0)) return;
    image.cameras[at] = static_cast<float>(sum * sum / squares);
    image.nearest_ray[at] = static_cast<float>(nearest);
  };

  raystage::parallel_for(0, view.height, [&](int y) {
    for (int x = 0; x < view.width; ++x) {
      measure(x, y,
              static_cast<std::size_t>(y) * static_cast<std::size_t>(view.width) +
                  static_cast<std::size_t>(x));
    }
  });
}

}  // namespace raystage
