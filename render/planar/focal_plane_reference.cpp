// SPDX-License-Identifier: Apache-2.0

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <limits>
#include <optional>

#include "base/error.h"
#include "base/parallel.h"
#include "base/transfer_function.h"
#include "render/common/plane_projection.h"
#include "render/common/ray_cells.h"
#include "render/planar/focal_plane.h"
#include "render/planar/reference_sampling.h"

namespace raystage {
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::Vector4d;

RenderedView render_focal_plane_reference(const VirtualCamera& view, const LightFieldFrame& instant,
                                          const Vector4d& plane, CornerWeights weights,
                                          bool count_needed_pixels,
                                          std::span<const ObjectPlane> objects) {
  RenderedView image = empty_view(view);
  const auto start = std::chrono::steady_clock::now();
  std::vector<std::shared_ptr<const DecodedFrame>> frames(instant.rig->cameras.size());
  std::vector<ReadPixelMask> read(frames.size());
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const int camera = static_cast<int>(i), frame = instant.frame_of_camera[i];
    if (frame < 0) continue;
    const auto layout = instant.cache->layout(camera, frame);
    frames[i] = instant.cache->fetch(camera, frame,
                                     McuMask(static_cast<std::size_t>(layout->mcu_count()), 1),
                                     image.statistics.pixels_decoded);
    ++image.statistics.cameras_used;
    if (!count_needed_pixels) continue;
    read[i].assign(
        static_cast<std::size_t>(frames[i]->width) * static_cast<std::size_t>(frames[i]->height),
        0);
  }
  const auto decoded = std::chrono::steady_clock::now();

  // Cells are located in an undistorted copy of the view, at the ray's pixel in that copy.
  VirtualCamera ideal_view = view;
  ideal_view.intrinsics.distortion = {};
  const CameraModel view_model({"view", view.width, view.height, view.intrinsics, {}, {}, {}});
  const RayCells present(ideal_view, *instant.rig, *instant.present);
  const RayCells complete(ideal_view, *instant.rig, *instant.complete);
  const double full_scale = instant.cache->full_scale();
  const bool perceptual = instant.cache->blend_space() == BlendSpace::kPerceptual;

  const auto plane_met = [&](const Vector3d& eye, const Vector3d& ray) -> const Vector4d& {
    const Vector4d* met = &plane;
    double nearest = std::numeric_limits<double>::infinity();
    for (const ObjectPlane& object : objects) {
      const auto along = intersect_ray(object, eye, ray);
      if (!along || *along >= nearest) continue;
      nearest = *along;
      met = &object.plane;
    }
    return *met;
  };
  const auto reconstruct = [&](int x, int y, float* rgba, float& coverage, float& z) {
    const auto ray_in_view = view_model.unproject({x + 0.5, y + 0.5});
    if (!ray_in_view) return;
    const Intrinsics& k = view.intrinsics;
    const double ideal_x = ray_in_view->x() * k.fx + k.cx;
    const double ideal_y = -ray_in_view->y() * k.fy + k.cy;
    auto crossing = present.locate(ideal_x, ideal_y);
    if (!crossing) return;
    if (weights == CornerWeights::kNearest) crossing = present.nearest(*crossing);
    const Vector3d ray = view.pose.world_from_camera_rotation * *ray_in_view;
    const RayPlaneIntersection hit(view.pose.position, ray, plane_met(view.pose.position, ray));
    if (!hit.is_in_front()) return;

    const RayCells::Cell& cell = present.cells()[static_cast<std::size_t>(crossing->cell)];
    std::array<double, 4> sum{};
    for (std::size_t i = 0; i < static_cast<std::size_t>(cell.count); ++i) {
      const auto camera = static_cast<std::size_t>(cell.camera[i]);
      const Rig::Camera& source = instant.rig->cameras[camera];
      const Vector3d towards = source.pose.world_from_camera_rotation.transpose() *
                               hit.direction_from(source.pose.position);
      Vector2d pixel;
      const double seen = visibility(source.model, towards, pixel);
      if (seen <= 0) continue;
      const FrameSample sample = sample_bilinear(*frames[camera], pixel, seen, read[camera]);
      const double weight = crossing->weight[i] * sample.seen;
      for (std::size_t c = 0; c < 3; ++c) sum[c] += weight * sample.rgb[c];
      sum[3] += weight * sample.alpha;
    }
    if (sum[3] > 0) {
      for (std::size_t c = 0; c < 3; ++c) {
        const double mean = sum[c] / sum[3];
        const double linear = perceptual ? linear_from_srgb(mean) : mean;
        rgba[c] = static_cast<float>(linear * full_scale * sum[3]);
      }
    }
    rgba[3] = static_cast<float>(sum[3]);
    coverage = rgba[3];
    if (instant.present != instant.complete) {
      if (auto whole = complete.locate(ideal_x, ideal_y)) {
        if (weights == CornerWeights::kNearest) whole = complete.nearest(*whole);
        const RayCells::Cell& whole_cell = complete.cells()[static_cast<std::size_t>(whole->cell)];
        for (std::size_t i = 0; i < static_cast<std::size_t>(whole_cell.count); ++i) {
          if (instant.is_present(whole_cell.camera[i])) continue;
          coverage -= rgba[3] * static_cast<float>(whole->weight[i]);
        }
        coverage = std::max(0.0F, coverage);  // all absent, and rounded
      }
    }
    if (rgba[3] > 0) z = static_cast<float>(hit.depth());
  };

  raystage::parallel_for(0, view.height, [&](int y) {
    for (int x = 0; x < view.width; ++x) {
      const std::size_t at = static_cast<std::size_t>(y) * static_cast<std::size_t>(view.width) +
                             static_cast<std::size_t>(x);
      reconstruct(x, y, &image.rgba[at * 4], image.coverage[at], image.z[at]);
    }
  });
  const auto end = std::chrono::steady_clock::now();
  for (const auto& pixels : read) {
    image.statistics.pixels_needed += std::count(pixels.begin(), pixels.end(), 1);
  }
  image.statistics.decode_ms = std::chrono::duration<double, std::milli>(decoded - start).count();
  image.statistics.render_ms = std::chrono::duration<double, std::milli>(end - decoded).count();
  return image;
}

}  // namespace raystage
