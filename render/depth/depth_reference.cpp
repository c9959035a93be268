// SPDX-License-Identifier: Apache-2.0
// Reference of the blending of method "depth", ray by ray in double. Each pixel is the mean of the
// samples of the tile's cameras at the view's depth. They are weighted by weight, visibility
// (point_visibility()) and two rounds of Cauchy reweighting; see BlendRun. Where cameras disagree,
// the fit over their positions is mixed in (fit_angular_reference()). Also renders views with lens
// distortion. Output as depth.cpp. Cost: O(pixels x cameras of a tile), all frames decoded.
#include <algorithm>
#include <array>
#include <cmath>
#include <mutex>
#include <optional>
#include <utility>

#include "render/depth/angular_fit.h"
#include "render/depth/blend_kernels.h"
#include "render/depth/depth.h"
#include "render/depth/surface_pairs.h"
#include "render/sampling/field_coverage.h"
#include "render/sampling/reference_renderer.h"

namespace raystage::render::depth {
namespace {

struct Sample {
  DepthSample at;
  double share = 0, visible = 0;
  double in_sight = 0;  ///< visible, also where the camera's depth is behind the point
};

struct Agreed {
  std::array<double, 3> code{};   ///< full scale 1
  double visible = 0, matte = 0;  ///< weights that see the point; those times matte alpha
  double in_sight = 0;            ///< weights of Sample::in_sight
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
    result.in_sight += s.share * s.in_sight * s.at.seen;
  }
  return result;
}

class Reference {
 public:
  Reference(const ViewRequest& request, const DepthViewPlan& plan)
      : request_(request),
        plan_(plan),
        renderer_(request),
        strengths_(request.view.width, request.view.height) {}

  RenderedView render() {
    measure_strengths();
    RenderedView image = renderer_.render(
        [&](const ReferenceRay& ray, ReferencePixel& pixel) { reconstruct(ray, pixel); });
    image.notes = plan_.notes;
    std::ranges::sort(edges_, {}, &EdgePixel::pixel);
    image.edges = std::move(edges_);
    image.statistics.pixels_decoded += plan_.work.pixels_decoded;
    if (request_.measure_coverage) measure_coverage(request_, plan_, image);
    return image;
  }

 private:
  /// Returns the nearest pixel of the view without distortion.
  std::array<int, 2> pinhole_pixel(const Eigen::Vector3d& ray) const {
    const Eigen::Vector3d in_camera =
        plan_.pinhole.pose.world_from_camera_rotation.transpose() * ray;
    const schemas::Intrinsics& k = plan_.pinhole.intrinsics;
    const InverseDepthMap& map = plan_.view_depths;
    const double u = k.fx * in_camera.x() / -in_camera.z() + k.cx;
    const double v = k.fy * in_camera.y() / in_camera.z() + k.cy;
    return {static_cast<int>(std::clamp(u, 0.0, map.width - 1.0)),
            static_cast<int>(std::clamp(v, 0.0, map.height - 1.0))};
  }

  /// Returns the samples of the tile's cameras at a depth; `is_front`: visible to those whose own
  /// depths are there.
  std::vector<Sample> samples_at(const ReferenceRay& ray, double depth, bool is_front) {
    const Eigen::Vector3d& eye = request_.view.pose.position;
    const BlendingField::Tile& tile = plan_.field.tile_at(ray.x, ray.y);
    std::vector<Sample> samples;
    for (const BlendingField::TileCamera& chosen : tile.cameras) {
      const rig::Rig::Camera& camera = request_.instant.rig->cameras[chosen.camera];
      Sample sample;
      sample.at = sample_at_depth_reference(eye, ray.direction, depth, camera,
                                            renderer_.frames().frame(chosen.camera),
                                            plan_.settings.interpolation);
      sample.share = BlendingField::share(tile, chosen, ray.x, ray.y);
      const Eigen::Vector3d towards = ray.direction + depth * (eye - camera.pose.position);
      sample.visible = sample.in_sight = point_visibility(plan_, chosen.camera, towards, depth);
      if (is_front) sample.visible = point_surface_share(plan_, chosen.camera, towards, depth);
      samples.push_back(sample);
    }
    return samples;
  }

  Agreed blend(const ReferenceRay& ray, double depth, bool is_front) {
    return agreed(samples_at(ray, depth, is_front), plan_.settings.agreement / 255);
  }

  /// Returns the fit of a pixel away from edges of depth; not valid where there is none.
  AngularFitOfPixel angular_fit(const ReferenceRay& ray) {
    const auto [u, v] = pinhole_pixel(ray.direction);
    const BlendingField::Tile& tile = plan_.field.tile_at(ray.x, ray.y);
    if (request_.instant.cache->has_matte() ||
        static_cast<float>(tile.cameras.size()) < kMinAngularCameras ||
        surface_pair(plan_.view_depths, u, v, angular_edge_separation(plan_))) {
      return {};
    }
    const auto depth = static_cast<double>(plan_.view_depths.at(u, v));
    const std::vector<Sample> samples = samples_at(ray, depth, false);
    const std::vector<AngularPosition> positions = angular_positions(request_, plan_, tile);
    const Eigen::Vector3d along =
        request_.view.pose.world_from_camera_rotation.transpose() * ray.direction;
    std::vector<AngularSample> fitted;
    for (std::size_t i = 0; i < samples.size(); ++i) {
      const Sample& s = samples[i];
      const AngularPosition& position = positions[i];
      const double distance = 1 - position.ahead_m * depth;
      if (!(s.at.seen > 0) || !(distance > double{kMinAngularDistance})) continue;
      AngularSample& sample = fitted.emplace_back();
      sample.x = (position.right - along.x() * position.ahead) / distance;
      sample.y = (position.up - along.y() * position.ahead) / distance;
      sample.seen = s.visible * s.at.seen;
      sample.weight = s.share * sample.seen;
      for (std::size_t c = 0; c < 3; ++c) sample.code[c] = 255 * s.at.code[c];
    }
    return fit_angular_reference(fitted);
  }

  void measure_strengths() {
    const ViewRays rays(request_.view);
    for (int y = 0; y < request_.view.height; ++y) {
      for (int x = 0; x < request_.view.width && AngularStrengths::is_measured(y); ++x) {
        const auto direction = rays.through(x + 0.5, y + 0.5);
        if (!direction) continue;
        const AngularFitOfPixel fit = angular_fit({x, y, *direction, {}});
        if (fit.is_valid) strengths_.measure(x, y, fit.difference, fit.noise);
      }
    }
    strengths_.decide();
  }

  /// Mixes the fit into a pixel, as far as it counts there.
  void mix_fit(const ReferenceRay& ray, ReferencePixel& pixel) {
    const float strength = strengths_.at(ray.x, ray.y);
    if (!(strength > 0)) return;
    const AngularFitOfPixel fit = angular_fit(ray);
    if (!fit.is_valid) return;
    std::array<double, 3> code = fit.code;
    for (double& value : code) value = std::clamp(value / 255, 0.0, 1.0);
    const auto light = premultiplied_light(code, 1, *request_.instant.cache);
    for (std::size_t c = 0; c < 3; ++c) {
      pixel.rgba[c] += strength * (light[c] * pixel.rgba[3] - pixel.rgba[c]);
    }
  }

  /// Returns premultiplied light.
  std::array<float, 4> rgba_of(const Agreed& blended) const {
    const double opacity = std::min(1.0, blended.visible / static_cast<double>(kFullAlphaWeight));
    const double alpha =
        opacity > 0 ? opacity * std::clamp(blended.matte / blended.visible, 0.0, 1.0) : 0;
    if (!(alpha > 0)) return {};
    std::array<double, 3> code = blended.code;
    for (double& value : code) value = std::clamp(value, 0.0, 1.0);
    return premultiplied_light(code, alpha, *request_.instant.cache);
  }

  void reconstruct(const ReferenceRay& ray, ReferencePixel& pixel) {
    const auto [u, v] = pinhole_pixel(ray.direction);
    float depth = plan_.view_depths.at(u, v);
    const auto separation = surface_separation(plan_, request_);
    const auto pair =
        separation ? surface_pair(plan_.view_depths, u, v, *separation) : std::nullopt;
    if (pair) {
      const Agreed front = blend(ray, static_cast<double>(pair->front), true),
                   behind = blend(ray, static_cast<double>(pair->behind), false);
      CombinedSurfaces both = combine_surfaces(
          *pair, {static_cast<float>(front.in_sight), static_cast<float>(front.visible)},
          rgba_of(front), rgba_of(behind));
      pixel.rgba = both.rgba;
      depth = both.inverse_depth;
      if (both.edge) {
        both.edge->pixel = static_cast<std::uint32_t>(ray.y * request_.view.width + ray.x);
        const std::scoped_lock lock(edges_mutex_);
        edges_.push_back(*both.edge);
      }
    } else {
      pixel.rgba = rgba_of(blend(ray, static_cast<double>(depth), false));
      mix_fit(ray, pixel);
    }
    const auto alpha = static_cast<double>(pixel.rgba[3]);
    if (!(alpha > 0)) return;
    pixel.coverage = static_cast<float>(
        alpha * (1 - absent_camera_weight(plan_.complete, request_.instant, ray.x, ray.y)));
    if (depth > 0) pixel.z = 1 / depth;
  }

  const ViewRequest& request_;
  const DepthViewPlan& plan_;
  ReferenceRenderer renderer_;
  AngularStrengths strengths_;
  std::mutex edges_mutex_;
  std::vector<EdgePixel> edges_;
};

}  // namespace

namespace {

/// Calls body(excess, is_unknown, weight) for the four pixels of a camera's depths around a point;
/// `excess`: how far, in tolerances, the camera's inverse depth is above the point's. Returns the
/// point's weight by VisibilityRun::border, or nullopt outside of the camera's depths.
template <class Body>
std::optional<double> for_depths_around(const DepthViewPlan& plan, int camera,
                                        const Eigen::Vector3d& towards, double inverse_depth,
                                        const Body& body) {
  const InverseDepthMap& map = plan.depths->maps[camera];
  const VirtualCamera& pinhole = plan.depths->pinholes[camera];
  const auto tolerance = static_cast<double>(visibility_tolerance(plan));
  const Eigen::Vector3d in_camera = pinhole.pose.world_from_camera_rotation.transpose() * towards;
  if (!(in_camera.z() < 0)) return std::nullopt;
  const schemas::Intrinsics& k = pinhole.intrinsics;
  const double u = k.fx * in_camera.x() / -in_camera.z() + k.cx;
  const double v = k.fy * in_camera.y() / in_camera.z() + k.cy;
  if (!(u >= 0 && v >= 0 && u <= map.width && v <= map.height)) return std::nullopt;
  const double there = inverse_depth / -in_camera.z();
  const double left = std::clamp(u - 0.5, 0.0, map.width - 1.0);
  const double top = std::clamp(v - 0.5, 0.0, map.height - 1.0);
  const int x0 = static_cast<int>(left), y0 = static_cast<int>(top);
  for (int y = y0; y <= y0 + 1; ++y) {
    for (int x = x0; x <= x0 + 1; ++x) {
      const double weight = (1 - std::abs(left - x)) * (1 - std::abs(top - y));
      const float its = map.at(std::min(x, map.width - 1), std::min(y, map.height - 1));
      body((its - there) / tolerance, its < 0, weight);
    }
  }
  const auto border = static_cast<double>(visibility_border(plan));
  if (!(border > 0)) return 1;
  return std::min(1.0, std::min({u, map.width - u, v, map.height - v}) / border);
}

/// Returns what a point that is outside of the camera's depths counts.
double beyond_depths(const DepthViewPlan& plan) { return visibility_border(plan) > 0 ? 0 : 1; }

/// Returns 1 up to 1 tolerance, and 0 from kOcclusionRamp on.
double visible_ramp(double tolerances) {
  return std::clamp((kOcclusionRamp - tolerances) / (kOcclusionRamp - 1), 0.0, 1.0);
}

}  // namespace

double point_visibility(const DepthViewPlan& plan, int camera, const Eigen::Vector3d& towards,
                        double inverse_depth) {
  double seen = 0;
  const auto border = for_depths_around(plan, camera, towards, inverse_depth,
                                        [&](double excess, bool /*is_unknown*/, double weight) {
                                          seen += weight * visible_ramp(excess);
                                        });
  return border ? *border * seen : beyond_depths(plan);
}

double point_surface_share(const DepthViewPlan& plan, int camera, const Eigen::Vector3d& towards,
                           double inverse_depth) {
  double there = 0;
  const auto border = for_depths_around(
      plan, camera, towards, inverse_depth, [&](double excess, bool is_unknown, double weight) {
        there += weight * (is_unknown ? 1 : visible_ramp(excess) * visible_ramp(-excess));
      });
  return border ? *border * there : beyond_depths(plan);
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
