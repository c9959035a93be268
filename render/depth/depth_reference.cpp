// SPDX-License-Identifier: Apache-2.0
// The same, ray by ray in double; views with lens distortion too.
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <limits>
#include <map>

#include "base/parallel.h"
#include "base/transfer_function.h"
#include "render/depth/blend_kernels.h"
#include "render/depth/depth.h"
#include "render/sampling/field_coverage.h"

namespace raystage::depth {
namespace {

struct Sample {
  DepthSample at;
  double share = 0, visible = 0;
};

struct Agreed {
  std::array<double, 3> code{};  ///< full scale 1
  double visible = 0,
         matte = 0;  ///< shares that see the point, and of them what is not transparent
};

/// See BlendRun.
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
      : request_(request), plan_(plan), frames_(request.instant.rig->cameras.size()) {}

  RenderedView render() {
    RenderedView image = empty_view(request_.view);
    fetch(image.statistics);
    raystage::parallel_for(0, request_.view.height, [&](int y) {
      for (int x = 0; x < request_.view.width; ++x) render_pixel(x, y, image);
    });
    image.notes = plan_.notes;
    image.statistics.pixels_decoded += plan_.work.pixels_decoded;
    if (request_.measure_coverage) measure_coverage(request_, plan_, image);
    return image;
  }

 private:
  void fetch(RenderStatistics& statistics) {
    for (std::size_t i = 0; i < frames_.size(); ++i) {
      if (!request_.instant.is_present(static_cast<int>(i))) continue;
      frames_[i] = request_.instant.cache->fetch(
          static_cast<int>(i), request_.instant.frame_of_camera[i], {}, statistics.pixels_decoded);
      ++statistics.cameras_used;
    }
  }

  /// Of the nearest pixel of the view without distortion.
  double inverse_depth(const Eigen::Vector3d& ray) const {
    const Eigen::Vector3d in_camera =
        plan_.pinhole.pose.world_from_camera_rotation.transpose() * ray;
    const Intrinsics& k = plan_.pinhole.intrinsics;
    const InverseDepthMap& map = plan_.view_depths;
    const double u = k.fx * in_camera.x() / -in_camera.z() + k.cx;
    const double v = k.fy * in_camera.y() / in_camera.z() + k.cy;
    return map.at(static_cast<int>(std::clamp(u, 0.0, map.width - 1.0)),
                  static_cast<int>(std::clamp(v, 0.0, map.height - 1.0)));
  }

  void render_pixel(int x, int y, RenderedView& image) const {
    const auto ray = ViewRays(request_.view).through(x + 0.5, y + 0.5);
    if (!ray) return;
    const Eigen::Vector3d& eye = request_.view.pose.position;
    const double depth = inverse_depth(*ray);
    const BlendingField::Tile& tile =
        plan_.field.tile(x / BlendingField::kTile, y / BlendingField::kTile);
    std::vector<Sample> samples;
    for (const BlendingField::TileCamera& chosen : tile.cameras) {
      const auto i = static_cast<std::size_t>(chosen.camera);
      const Rig::Camera& camera = request_.instant.rig->cameras[i];
      Sample sample;
      sample.at =
          sample_at_depth_reference(eye, *ray, depth, camera, *frames_[i], plan_.settings.look_up);
      sample.share = BlendingField::share(tile, chosen, x, y);
      sample.visible = point_visibility(plan_, chosen.camera,
                                        *ray + depth * (eye - camera.pose.position), depth);
      samples.push_back(sample);
    }
    const Agreed result = agreed(samples, plan_.settings.agreement / 255);
    const double opacity = std::min(1.0, result.visible / static_cast<double>(kFullAlphaWeight));
    const double alpha =
        opacity > 0 ? opacity * std::clamp(result.matte / result.visible, 0.0, 1.0) : 0;
    if (!(alpha > 0)) return;
    const FrameCache& cache = *request_.instant.cache;
    const std::size_t at = static_cast<std::size_t>(y) * static_cast<std::size_t>(image.width) +
                           static_cast<std::size_t>(x);
    for (std::size_t c = 0; c < 3; ++c) {
      const double code = std::clamp(result.code[c], 0.0, 1.0);
      const double linear =
          cache.blend_space() == BlendSpace::kPerceptual ? linear_from_srgb(code) : code;
      image.rgba[at * 4 + c] = static_cast<float>(alpha * linear * cache.full_scale());
    }
    image.rgba[at * 4 + 3] = static_cast<float>(alpha);
    image.coverage[at] =
        static_cast<float>(alpha * (1 - absent_camera_weight(plan_, request_.instant, x, y)));
    image.z[at] =
        depth > 0 ? static_cast<float>(1 / depth) : std::numeric_limits<float>::infinity();
  }

  const ViewRequest& request_;
  const DepthViewPlan& plan_;
  std::vector<std::shared_ptr<const DecodedFrame>> frames_;
};

}  // namespace

double point_visibility(const DepthViewPlan& plan, int camera, const Eigen::Vector3d& towards,
                        double inverse_depth) {
  const InverseDepthMap& map = plan.depths->maps[static_cast<std::size_t>(camera)];
  const VirtualCamera& pinhole = plan.depths->pinholes[static_cast<std::size_t>(camera)];
  const auto tolerance = static_cast<double>(visibility_tolerance(plan));
  const Eigen::Vector3d in_camera = pinhole.pose.world_from_camera_rotation.transpose() * towards;
  if (!(in_camera.z() < 0)) return 1;
  const Intrinsics& k = pinhole.intrinsics;
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

}  // namespace raystage::depth
