// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <optional>

#include "base/parallel.h"
#include "base/transfer_function.h"
#include "render/common/ray_cells.h"
#include "render/common/ray_coverage.h"
#include "render/planar/aperture.h"
#include "render/planar/aperture_lens.h"
#include "render/planar/depth_map.h"
#include "render/planar/reference_sampling.h"

namespace raystage {

using Eigen::Vector2d;
using Eigen::Vector3d;

RenderedView render_aperture_reference(const ViewRequest& request) {
  const VirtualCamera& view = request.view;
  const LightFieldFrame& instant = request.instant;
  RenderedView image = empty_view(view);
  const double focus_distance = request.options.number("focus_distance");
  const Eigen::Vector4d plane =
      focus_distance > 0 ? view_parallel_plane(view, focus_distance) : request.focal_plane;
  const ApertureLens lens(view, instant, plane, request.options);
  const std::optional<ViewDepths> depths = make_view_depths(request);

  const std::size_t count = instant.rig->cameras.size();
  std::vector<std::shared_ptr<const DecodedFrame>> frames(count);
  std::vector<ReadPixelMask> read(count);
  for (std::size_t i = 0; i < count; ++i) {
    const int camera = static_cast<int>(i), frame = instant.frame_of_camera[i];
    if (frame < 0) continue;
    const auto layout = instant.cache->layout(camera, frame);
    frames[i] = instant.cache->fetch(camera, frame,
                                     McuMask(static_cast<std::size_t>(layout->mcu_count()), 1),
                                     image.statistics.pixels_decoded);
    ++image.statistics.cameras_used;
    if (!request.count_needed_pixels) continue;
    read[i].assign(
        static_cast<std::size_t>(frames[i]->width) * static_cast<std::size_t>(frames[i]->height),
        0);
  }

  // Cells are located in an undistorted copy of the view.
  VirtualCamera ideal_view = view;
  ideal_view.intrinsics.distortion = {};
  const CameraModel view_model({"view", view.width, view.height, view.intrinsics, {}, {}, {}});
  const RayCells cells(ideal_view, *instant.rig, *instant.present);
  const bool perceptual = instant.cache->blend_space() == BlendSpace::kPerceptual;

  if (request.measure_coverage) {
    image.cameras.assign(image.coverage.size(), 0.0F);
    image.nearest_ray = image.z;  // infinity
  }

  const auto reconstruct = [&](int x, int y, float* rgba, float& coverage, float& z,
                               RayCoverage& behind) {
    const auto ray_in_view = view_model.unproject({x + 0.5, y + 0.5});
    if (!ray_in_view) return;
    const Intrinsics& k = view.intrinsics;
    const auto crossing =
        cells.locate(ray_in_view->x() * k.fx + k.cx, -ray_in_view->y() * k.fy + k.cy);
    if (!crossing) return;
    const Vector3d ray = view.pose.world_from_camera_rotation * *ray_in_view;
    const RayPlaneIntersection hit =
        depths ? RayPlaneIntersection(view.pose.position, ray,
                                      1 / static_cast<double>(depths->at(x, y)))
               : RayPlaneIntersection(view.pose.position, ray, plane);
    if (!hit.is_in_front()) return;
    const RayCells::Cell& cell = cells.cells()[static_cast<std::size_t>(crossing->cell)];
    Vector2d place = Vector2d::Zero();
    for (std::size_t i = 0; i < static_cast<std::size_t>(cell.count); ++i) {
      place += crossing->weight[i] * lens.cameras()[static_cast<std::size_t>(cell.camera[i])].place;
    }
    std::array<double, 3> sum{};
    double seen_weight = 0, present = 0, complete = 0;
    for (std::size_t i = 0; i < count; ++i) {
      const double weight = lens.weight(lens.cameras()[i], place);
      if (weight == 0) continue;
      complete += weight;
      if (!frames[i]) continue;
      present += weight;
      const Rig::Camera& source = instant.rig->cameras[i];
      const Vector3d towards = source.pose.world_from_camera_rotation.transpose() *
                               hit.direction_from(source.pose.position);
      Vector2d pixel;
      const double seen = visibility(source.model, towards, pixel);
      if (seen <= 0) continue;
      const FrameSample sample = sample_bilinear(*frames[i], pixel, seen, read[i]);
      for (std::size_t c = 0; c < 3; ++c) sum[c] += weight * seen * sample.rgb[c];
      seen_weight += weight * seen * sample.alpha;
      behind.add(weight * seen, ray, source.pose.position - view.pose.position);
    }
    if (!(seen_weight > 0)) return;
    const double alpha = seen_weight / present;
    for (std::size_t c = 0; c < 3; ++c) {
      const double mean = sum[c] / seen_weight;
      const double linear = perceptual ? linear_from_srgb(mean) : mean;
      rgba[c] = static_cast<float>(linear * instant.cache->full_scale() * alpha);
    }
    rgba[3] = static_cast<float>(alpha);
    coverage = static_cast<float>(alpha * present / complete);
    z = static_cast<float>(hit.depth());
  };

  raystage::parallel_for(0, view.height, [&](int y) {
    for (int x = 0; x < view.width; ++x) {
      const std::size_t at = static_cast<std::size_t>(y) * static_cast<std::size_t>(view.width) +
                             static_cast<std::size_t>(x);
      RayCoverage behind;
      reconstruct(x, y, &image.rgba[at * 4], image.coverage[at], image.z[at], behind);
      if (!request.measure_coverage) continue;
      image.cameras[at] = behind.cameras();
      image.nearest_ray[at] = behind.nearest_ray();
    }
  });
  for (const ReadPixelMask& pixels : read) {
    image.statistics.pixels_needed += std::ranges::count(pixels, 1);
  }
  return image;
}

}  // namespace raystage
