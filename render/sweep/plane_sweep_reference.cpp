// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>

#include "base/transfer_function.h"
#include "render/matching/matching.h"
#include "render/sampling/field_coverage.h"
#include "render/sweep/cost_kernels.h"
#include "render/sweep/edge_guide.h"
#include "render/sweep/plane_sweep.h"

namespace raystage::plane_sweep {
namespace {

using Eigen::Vector3d;

/// What a camera that counts shows of a pixel's point.
struct Sample {
  std::array<double, 3> code{};  // not premultiplied
  double share = 0, alpha = 1;
};

/// So many times the one farthest from the mean of those left, as long as there are more than two.
void leave_out(int cameras, std::vector<Sample>& samples) {
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

/// Everything pixel by pixel, in double.
class Reference {
 public:
  Reference(const ViewRequest& request, const PlaneSweepPlan& plan)
      : request_(request), plan_(plan), rays_(request.view), frames_(cameras().size()) {}

  RenderedView render() {
    RenderedView image = empty_view(request_.view);
    image.notes = plan_.notes;
    const auto start = std::chrono::steady_clock::now();
    decode(image.statistics);
    const auto decoded = std::chrono::steady_clock::now();
    PlaneMap map = match({});
    if (plan_.settings.edge_scale > 0) {
      RenderedView first = empty_view(request_.view);
      blend(map, first);
      map = match(edge_guide(first, request_.instant.cache->full_scale()));
    }
    blend(map, image);
    const auto end = std::chrono::steady_clock::now();
    if (request_.measure_coverage) measure_view_coverage(request_, plan_.field, {}, image);
    image.statistics.decode_ms = std::chrono::duration<double, std::milli>(decoded - start).count();
    image.statistics.render_ms = std::chrono::duration<double, std::milli>(end - decoded).count();
    return image;
  }

 private:
  const std::vector<Rig::Camera>& cameras() const { return request_.instant.rig->cameras; }

  void decode(RenderStatistics& statistics) {
    FrameCache& cache = *request_.instant.cache;
    for (std::size_t i = 0; i < frames_.size(); ++i) {
      const int camera = static_cast<int>(i), frame = request_.instant.frame_of_camera[i];
      if (frame < 0) continue;
      const auto layout = cache.layout(camera, frame);
      frames_[i] =
          cache.fetch(camera, frame, McuMask(static_cast<std::size_t>(layout->mcu_count()), 1),
                      statistics.pixels_decoded);
      ++statistics.cameras_used;
    }
  }

  double cost(const BlendingField::Tile& tile, const Vector3d& ray, double inverse_depth) const {
    std::vector<ReferenceCamera> matched;
    for (const int camera : tile.best) {
      const auto i = static_cast<std::size_t>(camera);
      matched.push_back({&cameras()[i], frames_[i].get()});
    }
    return matching_cost_reference(matched, request_.instant.cache->blend_space(),
                                   request_.view.pose.position, ray, inverse_depth,
                                   plan_.settings.truncation, plan_.settings.excluded_cameras);
  }

  void fill_row(int y, std::span<std::uint8_t> costs) const {
    const auto stride = static_cast<std::size_t>(plane_stride(plan_.planes.count));
    for (int x = 0; x < request_.view.width; ++x) {
      const auto ray = rays_.through(x + 0.5, y + 0.5);
      const BlendingField::Tile& tile =
          plan_.field.tile(x / BlendingField::kTile, y / BlendingField::kTile);
      for (int plane = 0; plane < plan_.planes.count; ++plane) {
        const double value =
            ray ? cost(tile, *ray, plan_.planes.inverse_depth(plane)) : kUnknownCost;
        costs[static_cast<std::size_t>(x) * stride + static_cast<std::size_t>(plane)] =
            static_cast<std::uint8_t>(std::lround(value));
      }
    }
  }

  PlaneMap match(std::span<const std::uint8_t> guide) const {
    const CostVolume volume{request_.view.width, request_.view.height, plan_.planes.count};
    const PlaneSweepSettings& s = plan_.settings;
    const FillCosts fill = [&](int y, std::span<std::uint8_t> costs) { fill_row(y, costs); };
    if (s.aggregation != Aggregation::kSemiGlobal) {
      return box_match_reference(volume, fill,
                                 s.aggregation == Aggregation::kBox ? s.box_radius : 0,
                                 s.subplane_refinement);
    }
    return semi_global_match_reference(volume, fill, semi_global_settings(s, guide));
  }

  void blend(const PlaneMap& map, RenderedView& image) const {
    for (int y = 0; y < image.height; ++y) {
      for (int x = 0; x < image.width; ++x) {
        const std::size_t at = static_cast<std::size_t>(y) * static_cast<std::size_t>(image.width) +
                               static_cast<std::size_t>(x);
        blend(x, y, plan_.planes.inverse_depth(static_cast<double>(map.plane[at])),
              &image.rgba[at * 4], image.coverage[at], image.z[at]);
      }
    }
  }
  void blend(int x, int y, double inverse_depth, float* rgba, float& coverage, float& z) const {
    const auto ray = rays_.through(x + 0.5, y + 0.5);
    if (!ray) return;
    const BlendingField::Tile& tile =
        plan_.field.tile(x / BlendingField::kTile, y / BlendingField::kTile);
    std::vector<Sample> samples;
    double seen = 0, matte = 0;
    for (const BlendingField::TileCamera& camera : tile.cameras) {
      const auto i = static_cast<std::size_t>(camera.camera);
      const DepthSample sample =
          sample_at_depth_reference(request_.view.pose.position, *ray, inverse_depth, cameras()[i],
                                    *frames_[i], plan_.settings.look_up);
      const double share =
          sample.seen * static_cast<double>(BlendingField::share(tile, camera, x, y));
      seen += share;
      if (!(share * sample.alpha > 0)) continue;
      samples.push_back({sample.code, share, sample.alpha});
      for (double& code : samples.back().code) code /= sample.alpha;
      matte += share * sample.alpha;
    }
    if (seen <= 0 || matte <= 0) return;
    leave_out(plan_.settings.excluded_cameras, samples);
    std::array<double, 3> sum{};
    double weight = 0;
    for (const Sample& sample : samples) {
      const double share = sample.share * sample.alpha;
      for (std::size_t c = 0; c < 3; ++c) sum[c] += share * sample.code[c];
      weight += share;
    }
    // Of opaque frames those that were left out do not count; with a matte all do, as each says
    // what is there.
    if (!request_.instant.cache->has_matte()) seen = matte = weight;
    const double alpha =
        std::min(1.0, seen / static_cast<double>(kFullAlphaWeight)) * std::min(1.0, matte / seen);
    const FrameCache& cache = *request_.instant.cache;
    for (std::size_t c = 0; c < 3; ++c) {
      const double mean = std::clamp(sum[c] / weight, 0.0, 1.0);
      const double light =
          cache.blend_space() == BlendSpace::kPerceptual ? linear_from_srgb(mean) : mean;
      rgba[c] = static_cast<float>(light * cache.full_scale() * alpha);
    }
    rgba[3] = static_cast<float>(alpha);
    coverage = rgba[3] * (1 - absent_camera_weight(plan_, request_.instant, x, y));
    if (inverse_depth > 0) z = static_cast<float>(1 / inverse_depth);
  }

  const ViewRequest& request_;
  const PlaneSweepPlan& plan_;
  ViewRays rays_;
  std::vector<std::shared_ptr<const DecodedFrame>> frames_;
};

}  // namespace

RenderedView render_reference(const ViewRequest& request) {
  const std::optional<PlaneSweepPlan> made = plan(request);
  if (!made) return transparent_view(request);
  return Reference(request, *made).render();
}

}  // namespace raystage::plane_sweep
