// SPDX-License-Identifier: Apache-2.0
// Computes the geometry of source cameras for pixels with individual depths (DepthSource), and
// samples one ray at a depth in double. sample_at_depth_reference() is the reference of the kernels
// in depth_sampling_kernels.cpp: bilinear or bicubic interpolation (Keys 1981). Input: ray in the
// world, inverse planar depth (1/m). Output: codes of the blend space times alpha, full scale 1.
// Cost: 16 pixels per sample.
#include "render/sampling/depth_sampling.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "render/common/ray_cells.h"
#include "render/sampling/direction_visibility.h"

namespace raystage::render {

DepthSource depth_source(const VirtualCamera& view, const rig::Rig::Camera& camera,
                         double reference) {
  DepthSource source;
  Eigen::Matrix3d ideal_from_world = camera.pose.world_from_camera_rotation.transpose();
  ideal_from_world.row(1) *= -1;  // camera y up, image y down
  ideal_from_world.row(2) *= -1;  // the camera looks down -z
  if (const rig::Facet* facet = camera.model.facet()) {
    ideal_from_world = facet->lens_from_facet * ideal_from_world;
  }
  Eigen::Matrix3d from_pixel = ideal_from_world * world_ray_from_pixel(view);
  const Eigen::Vector3d to_eye = ideal_from_world * (view.pose.position - camera.pose.position);
  from_pixel.col(2) += reference * to_eye;
  source.camera = make_source_view(camera.model, from_pixel);
  source.per_inverse_depth = {to_eye[0], to_eye[1], to_eye[2]};
  return source;
}

void set_mcu_layout(SourceView& camera, const store::JpegLayout& layout, std::uint8_t* mcus) {
  camera.wanted_mcus = mcus;
  camera.mcus_per_row = layout.mcus_per_row;
  camera.mcu_width_log2 = std::countr_zero(static_cast<unsigned>(layout.mcu_width));
  camera.mcu_height_log2 = std::countr_zero(static_cast<unsigned>(layout.mcu_height));
  camera.chroma_radius = layout.mcu_width > 8 || layout.mcu_height > 8 ? 1 : 0;
}

namespace {

/// Returns the weight of Keys' kernel at a distance in pixels.
double cubic_weight(double distance) {
  constexpr double a = kCubicSlope;
  const double t = std::abs(distance);
  if (t < 1) return ((a + 2) * t - (a + 3)) * t * t + 1;
  if (t < 2) return a * (((t - 5) * t + 8) * t - 4);
  return 0;
}

}  // namespace

DepthSample sample_at_depth_reference(const Eigen::Vector3d& eye, const Eigen::Vector3d& ray,
                                      double inverse_depth, const rig::Rig::Camera& camera,
                                      const store::DecodedFrame& frame,
                                      Interpolation interpolation) {
  DepthSample sample;
  const Eigen::Vector3d towards = camera.pose.world_from_camera_rotation.transpose() *
                                  (ray + inverse_depth * (eye - camera.pose.position));
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  sample.seen = direction_visibility(camera.model, towards, pixel);
  sample.u = pixel.x();
  sample.v = pixel.y();
  if (!(sample.seen > 0)) {
    sample.seen = 0;
    return sample;
  }

  const double left = std::clamp(sample.u - 0.5, 0.0, frame.width - 1.0);
  const double top = std::clamp(sample.v - 0.5, 0.0, frame.height - 1.0);
  const int x0 = static_cast<int>(left), y0 = static_cast<int>(top);
  const auto weight = [&](double distance) {
    return interpolation == Interpolation::kCubic ? cubic_weight(distance)
                                                  : std::max(0.0, 1 - std::abs(distance));
  };
  for (int y = y0 - 1; y <= y0 + 2; ++y) {
    for (int x = x0 - 1; x <= x0 + 2; ++x) {
      const auto row = static_cast<std::size_t>(std::clamp(y, 0, frame.height - 1));
      const auto column = static_cast<std::size_t>(std::clamp(x, 0, frame.width - 1));
      const std::size_t at = row * frame.width + column;
      const double w = weight(left - x) * weight(top - y);
      if (w == 0) continue;  // the pixel may not be decoded
      for (std::size_t c = 0; c < 3; ++c) sample.code[c] += w * frame.rgba[at * 4 + c] / 65535.0;
      sample.alpha += w * frame.rgba[at * 4 + 3] / 65535.0;
    }
  }
  // Removes rounding, so that opaque samples stay exactly equal for all weights.
  if (std::abs(sample.alpha - 1) < 1e-9) sample.alpha = 1;
  return sample;
}

}  // namespace raystage::render
