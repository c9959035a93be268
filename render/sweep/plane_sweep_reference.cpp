// SPDX-License-Identifier: Apache-2.0
// Reference of plane_sweep.cpp, pixel by pixel in double: matching_cost_reference() on every plane,
// aggregation by matching, then the weighted mean of the cameras that see the point. Output as
// plane_sweep.cpp; decodes all frames whole. Cost: O(pixels x planes x cameras).
#include <algorithm>
#include <cmath>

#include "matching/matching.h"
#include "render/sampling/field_coverage.h"
#include "render/sampling/reference_renderer.h"
#include "render/sweep/cost_kernels.h"
#include "render/sweep/edge_guide.h"
#include "render/sweep/plane_sweep.h"

namespace raystage::render::plane_sweep {
namespace {

using Eigen::Vector3d;

struct Sample {
  std::array<double, 3> code{};  // not premultiplied
  double share = 0, alpha = 1;
};

/// Removes `cameras` times the sample farthest from the mean of the rest, if more than two remain.
void exclude_outliers(int cameras, std::vector<Sample>& samples) {
  for (int i = 0; i < cameras && samples.size() > 2; ++i) {
    std::array<double, 3> mean{};
    for (const Sample& sample : samples) {
      for (std::size_t c = 0; c < 3; ++c) {
        mean[c] += sample.code[c] / static_cast<double>(samples.size());
      }
    }
    samples.erase(std::ranges::max_element(samples, {}, [&](const Sample& sample) {
      double off = 0;
      for (std::size_t c = 0; c < 3; ++c) off += std::abs(sample.code[c] - mean[c]);
      return off;
    }));
  }
}

class Reference {
 public:
  Reference(const ViewRequest& request, const PlaneSweepPlan& plan)
      : request_(request), plan_(plan), rays_(request.view), renderer_(request) {}

  RenderedView render() {
    matching::PlaneMap map = match({});
    if (plan_.settings.edge_scale > 0) {
      map = match(edge_guide(blend(map), request_.instant.cache->scale()));
    }
    RenderedView image = blend(map);
    image.notes = plan_.notes;
    if (request_.measure_coverage) measure_view_coverage(request_, plan_.field, {}, image);
    return image;
  }

 private:
  const std::vector<rig::Rig::Camera>& cameras() const { return request_.instant.rig->cameras; }

  double cost(const BlendingField::Tile& tile, const Vector3d& ray, double inverse_depth) {
    std::vector<ReferenceCamera> matched;
    for (const int camera : tile.best) {
      matched.push_back({&cameras()[camera], &renderer_.frames().frame(camera)});
    }
    return matching_cost_reference(matched, request_.instant.cache->scale(),
                                   request_.view.pose.position, ray, inverse_depth,
                                   plan_.settings.truncation, plan_.settings.excluded_cameras);
  }

  void fill_row(int y, std::span<std::uint8_t> costs) {
    const auto stride = static_cast<std::size_t>(matching::plane_stride(plan_.planes.count));
    for (int x = 0; x < request_.view.width; ++x) {
      const auto ray = rays_.through(x + 0.5, y + 0.5);
      const BlendingField::Tile& tile = plan_.field.tile_at(x, y);
      for (int plane = 0; plane < plan_.planes.count; ++plane) {
        const double value =
            ray ? cost(tile, *ray, plan_.planes.inverse_depth(plane)) : matching::kUnknownCost;
        costs[static_cast<std::size_t>(x) * stride + plane] =
            static_cast<std::uint8_t>(std::lround(value));
      }
    }
  }

  matching::PlaneMap match(std::span<const std::uint8_t> guide) {
    const matching::CostVolume volume{request_.view.width, request_.view.height,
                                      plan_.planes.count};
    const PlaneSweepOptions& s = plan_.settings;
    const matching::FillCosts fill = [&](int y, std::span<std::uint8_t> costs) {
      fill_row(y, costs);
    };
    if (s.aggregation != Aggregation::kSemiGlobal) {
      return matching::box_match_reference(volume, fill,
                                           s.aggregation == Aggregation::kBox ? s.box_radius : 0,
                                           s.subplane_refinement);
    }
    return matching::semi_global_match_reference(volume, fill, semi_global_options(s, guide));
  }

  RenderedView blend(const matching::PlaneMap& map) {
    return renderer_.render([&](const ReferenceRay& ray, ReferencePixel& pixel) {
      const std::size_t at = static_cast<std::size_t>(ray.y) * map.width + ray.x;
      blend(ray, plan_.planes.inverse_depth(static_cast<double>(map.plane[at])), pixel);
    });
  }

  void blend(const ReferenceRay& ray, double inverse_depth, ReferencePixel& pixel) {
    const BlendingField::Tile& tile = plan_.field.tile_at(ray.x, ray.y);
    std::vector<Sample> samples;
    double seen = 0, matte = 0;
    for (const BlendingField::TileCamera& camera : tile.cameras) {
      const DepthSample sample = sample_at_depth_reference(
          request_.view.pose.position, ray.direction, inverse_depth, cameras()[camera.camera],
          renderer_.frames().frame(camera.camera), plan_.settings.interpolation);
      const double share =
          sample.seen * static_cast<double>(BlendingField::share(tile, camera, ray.x, ray.y));
      seen += share;
      if (!(share * sample.alpha > 0)) continue;
      samples.push_back({sample.code, share, sample.alpha});
      for (double& code : samples.back().code) code /= sample.alpha;
      matte += share * sample.alpha;
    }
    if (seen <= 0 || matte <= 0) return;
    exclude_outliers(plan_.settings.excluded_cameras, samples);
    std::array<double, 3> sum{};
    double weight = 0;
    for (const Sample& sample : samples) {
      const double share = sample.share * sample.alpha;
      for (std::size_t c = 0; c < 3; ++c) sum[c] += share * sample.code[c];
      weight += share;
    }
    // Excluded cameras do not count for opaque frames; with a matte all count towards alpha.
    if (!request_.instant.cache->has_matte()) seen = matte = weight;
    const double alpha =
        std::min(1.0, seen / static_cast<double>(kFullAlphaWeight)) * std::min(1.0, matte / seen);
    for (double& value : sum) value = std::clamp(value / weight, 0.0, 1.0);
    pixel.rgba = premultiplied_light(sum, alpha, *request_.instant.cache);
    pixel.coverage =
        pixel.rgba[3] * (1 - absent_camera_weight(plan_.complete, request_.instant, ray.x, ray.y));
    if (inverse_depth > 0) pixel.z = static_cast<float>(1 / inverse_depth);
  }

  const ViewRequest& request_;
  const PlaneSweepPlan& plan_;
  ViewRays rays_;
  ReferenceRenderer renderer_;
};

}  // namespace

RenderedView render_reference(const ViewRequest& request) {
  const std::optional<PlaneSweepPlan> made = plan(request);
  if (!made) return transparent_view(request);
  return Reference(request, *made).render();
}

}  // namespace raystage::render::plane_sweep
