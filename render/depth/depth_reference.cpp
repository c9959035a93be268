// SPDX-License-Identifier: Apache-2.0
// Reference of the blending of method "depth", ray by ray in double. Each pixel is the mean of the
// samples of the tile's cameras at the view's depth. They are weighted by weight, visibility
// (point_visibility()) and two rounds of Cauchy reweighting; see BlendRun. Also renders views with
// lens distortion. Output as depth.cpp. Cost: O(pixels x cameras of a tile), all frames decoded.
#include <algorithm>
#include <array>
#include <cmath>

#include "render/depth/blend_kernels.h"
#include "render/depth/depth.h"
#include "render/sampling/field_coverage.h"
#include "render/sampling/reference_renderer.h"

namespace raystage::render::depth {
namespace {

struct Sample {
  DepthSample at;
  double share = 0, visible = 0;
};

struct Agreed {
  std::array<double, 3> code{};   ///< full scale 1
  double visible = 0, matte = 0;  ///< weights that see the point; those times matte alpha
};

Agreed agreed(const std::vector<Sample>& samples, double agreement) {
  Agreed result;
  const auto mean = [&](const auto& trust) {
    std::array<double, 3> sum{};
    double weights = 0;
    for (const Sample& s : samples) {
      const double weight = s.share * (s.visible + kMinVisibleWeight) * s.at.seen * trust(s);
      weights += weight * s.at.alpha;
      for (std::size_t c = 0; c < 3; ++c) sum[c] += weight * s.at.code[c];
    }
    for (double& value : sum) value = weights > 0 ? value / weights : 0;
    return sum;
  };
  std::array<double, 3> colour = mean([](const Sample&) { return 1.0; });
  for (int round = 0; round < 2; ++round) {
    colour = mean([&](const Sample& s) {
      double square = 0;
      for (std::size_t c = 0; c < 3 && s.at.alpha > 0; ++c) {
        square += std::pow(s.at.code[c] / s.at.alpha - colour[c], 2) / 3;
      }
      return 1 / (1 + square / (agreement * agreement));
    });
  }
  result.code = colour;
  for (const Sample& s : samples) {
    const double visible = s.share * s.visible * s.at.seen;
    result.visible += visible;
    result.matte += visible * s.at.alpha;
  }
  return result;
}

class Reference {
 public:
  Reference(const ViewRequest& request, const DepthViewPlan& plan)
      : request_(request), plan_(plan), renderer_(request) {}

  RenderedView render() {
    RenderedView image = renderer_.render(
        [&](const ReferenceRay& ray, ReferencePixel& pixel) { reconstruct(ray, pixel); });
    image.notes = plan_.notes;
    image.statistics.pixels_decoded += plan_.work.pixels_decoded;
    if (request_.measure_coverage) measure_coverage(request_, plan_, image);
    return image;
  }

 private:
  /// Returns the inverse depth of the nearest pixel of the view without distortion, 1/m.
  double inverse_depth(const Eigen::Vector3d& ray) const {
    const Eigen::Vector3d in_camera =
        plan_.pinhole.pose.world_from_camera_rotation.transpose() * ray;
    const schemas::Intrinsics& k = plan_.pinhole.intrinsics;
    const InverseDepthMap& map = plan_.view_depths;
    const double u = k.fx * in_camera.x() / -in_camera.z() + k.cx;
    const double v = k.fy * in_camera.y() / in_camera.z() + k.cy;
    return map.at(static_cast<int>(std::clamp(u, 0.0, map.width - 1.0)),
                  static_cast<int>(std::clamp(v, 0.0, map.height - 1.0)));
  }

  void reconstruct(const ReferenceRay& ray, ReferencePixel& pixel) {
    const Eigen::Vector3d& eye = request_.view.pose.position;
    const double depth = inverse_depth(ray.direction);
    const BlendingField::Tile& tile = plan_.field.tile_at(ray.x, ray.y);
    std::vector<Sample> samples;
    for (const BlendingField::TileCamera& chosen : tile.cameras) {
      const rig::Rig::Camera& camera = request_.instant.rig->cameras[chosen.camera];
      Sample sample;
      sample.at = sample_at_depth_reference(eye, ray.direction, depth, camera,
                                            renderer_.frames().frame(chosen.camera),
                                            plan_.settings.interpolation);
      sample.share = BlendingField::share(tile, chosen, ray.x, ray.y);
      sample.visible = point_visibility(
          plan_, chosen.camera, ray.direction + depth * (eye - camera.pose.position), depth);
      samples.push_back(sample);
    }
    const Agreed result = agreed(samples, plan_.settings.agreement / 255);
    const double opacity = std::min(1.0, result.visible / static_cast<double>(kFullAlphaWeight));
    const double alpha =
        opacity > 0 ? opacity * std::clamp(result.matte / result.visible, 0.0, 1.0) : 0;
    if (!(alpha > 0)) return;
    std::array<double, 3> code = result.code;
    for (double& value : code) value = std::clamp(value, 0.0, 1.0);
    pixel.rgba = premultiplied_light(code, alpha, *request_.instant.cache);
    pixel.coverage = static_cast<float>(
        alpha * (1 - absent_camera_weight(plan_.complete, request_.instant, ray.x, ray.y)));
    if (depth > 0) pixel.z = static_cast<float>(1 / depth);
  }

  const ViewRequest& request_;
  const DepthViewPlan& plan_;
  ReferenceRenderer renderer_;
};

}  // namespace

double point_visibility(const DepthViewPlan& plan, int camera, const Eigen::Vector3d& towards,
                        double inverse_depth) {
  const InverseDepthMap& map = plan.depths->maps[camera];
  const VirtualCamera& pinhole = plan.depths->pinholes[camera];
  const auto tolerance = static_cast<double>(visibility_tolerance(plan));
  const Eigen::Vector3d in_camera = pinhole.pose.world_from_camera_rotation.transpose() * towards;
  if (!(in_camera.z() < 0)) return 1;
  const schemas::Intrinsics& k = pinhole.intrinsics;
  const double u = k.fx * in_camera.x() / -in_camera.z() + k.cx;
  const double v = k.fy * in_camera.y() / in_camera.z() + k.cy;
  if (!(u >= 0 && v >= 0 && u <= map.width && v <= map.height)) return 1;
  const double there = inverse_depth / -in_camera.z();
  const double left = std::clamp(u - 0.5, 0.0, map.width - 1.0);
  const double top = std::clamp(v - 0.5, 0.0, map.height - 1.0);
  const int x0 = static_cast<int>(left), y0 = static_cast<int>(top);
  double seen = 0;
  for (int y = y0; y <= y0 + 1; ++y) {
    for (int x = x0; x <= x0 + 1; ++x) {
      const double weight = (1 - std::abs(left - x)) * (1 - std::abs(top - y));
      const double nearer = map.at(std::min(x, map.width - 1), std::min(y, map.height - 1)) - there;
      seen += weight *
              std::clamp((kOcclusionRamp - nearer / tolerance) / (kOcclusionRamp - 1), 0.0, 1.0);
    }
  }
  return seen;
}

void measure_coverage(const ViewRequest& request, const DepthViewPlan& plan, RenderedView& image) {
  measure_view_coverage(
      request, plan.field,
      [&plan](int camera, const Eigen::Vector3d& towards, double inverse_depth) {
        return point_visibility(plan, camera, towards, inverse_depth);
      },
      image);
}

RenderedView render_reference(const ViewRequest& request) {
  const std::optional<DepthViewPlan> made = plan(request);
  if (!made) return transparent_view(request);
  return Reference(request, *made).render();
}

}  // namespace raystage::render::depth
