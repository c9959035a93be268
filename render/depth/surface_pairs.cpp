// SPDX-License-Identifier: Apache-2.0
// Finds pixels that show two surfaces, in a view's depths, and puts the surfaces together. The
// silhouette of an object in the depths of one camera is a staircase at its own pixels. The share
// of a pixel of the view that the object covers is that of the cameras whose depths show the object
// there: the mean over all staircases, which is soft (as the consensus of Penner and Zhang, "Soft
// 3D Reconstruction for View Synthesis", 2017). Cost: nine depths a pixel.
#include "render/depth/surface_pairs.h"

#include <algorithm>
#include <limits>

namespace raystage::render::depth {
namespace {

/// Surfaces that cover less of a pixel, or leave less of it, are not told apart.
constexpr float kLeastShare = 1.0F / 64;

}  // namespace

std::optional<SurfacePair> surface_pair(const InverseDepthMap& view_depths, int x, int y,
                                        float separation) {
  const float own = view_depths.at(x, y);
  float nearest = own, farthest = own;
  for (int row = std::max(0, y - 1); row <= std::min(view_depths.height - 1, y + 1); ++row) {
    for (int column = std::max(0, x - 1); column <= std::min(view_depths.width - 1, x + 1);
         ++column) {
      nearest = std::max(nearest, view_depths.at(column, row));
      farthest = std::min(farthest, view_depths.at(column, row));
    }
  }
  if (nearest - own > separation) return SurfacePair{nearest, own};
  if (own - farthest > separation) return SurfacePair{own, farthest};
  return std::nullopt;
}

std::optional<float> surface_separation(const DepthViewPlan& plan, const ViewRequest& request) {
  if (!plan.settings.soft_edges || request.supersampling > 1) return std::nullopt;
  // Where one hides the other from cameras.
  return kOcclusionRamp * visibility_tolerance(plan);
}

SurfaceRun surfaces_of_run(const InverseDepthMap& view_depths, int x, int y, int count,
                           std::optional<float> separation) {
  SurfaceRun run;
  const float* own = view_depths.values.data() + view_depths.offset(x, y);
  std::copy_n(own, count, run.front.begin());
  std::copy_n(own, count, run.behind.begin());
  for (int i = 0; separation && i < count; ++i) {
    const auto pair = surface_pair(view_depths, x + i, y, *separation);
    if (!pair) continue;
    if (!run.has_pairs()) run.begin = i;
    run.end = i + 1;
    run.is_pair[i] = true;
    run.front[i] = pair->front;
    run.behind[i] = pair->behind;
  }
  return run;
}

CombinedSurfaces combine_surfaces(const SurfacePair& pair, const FrontShare& share,
                                  std::span<const float, 4> front,
                                  std::span<const float, 4> behind) {
  const float opacity = std::min(1.0F, share.visible / kFullAlphaWeight);
  const float of_colour = std::min(1.0F, share.at / kFullAlphaWeight);
  const float covered = share.visible > 0 ? std::min(1.0F, share.at / share.visible) : 0;
  CombinedSurfaces result;
  const auto scaled_front = [&](float by) {
    std::array<float, 4> scaled{};
    for (std::size_t c = 0; c < 4 && of_colour > 0; ++c) {
      scaled[c] = front[c] * (by * opacity / of_colour);
    }
    return scaled;
  };
  if (covered < kLeastShare) {  // its colours would be those of cameras that see others
    std::ranges::copy(behind, result.rgba.begin());
    result.inverse_depth = pair.behind;
    return result;
  }
  // The less is known of what is behind, the more of the pixel is the front's.
  const float part = 1 - (1 - covered) * behind[3];
  if (part > 1 - kLeastShare) {
    result.rgba = scaled_front(1);
    result.inverse_depth = pair.front;
    return result;
  }
  EdgePixel edge;
  edge.front = scaled_front(part);
  std::ranges::copy(behind, edge.behind.begin());
  const auto depth_of = [](float inverse) {
    return inverse > 0 ? 1 / inverse : std::numeric_limits<float>::infinity();
  };
  edge.front_z = depth_of(pair.front);
  edge.behind_z = depth_of(pair.behind);
  for (std::size_t c = 0; c < 4; ++c) {
    result.rgba[c] = edge.front[c] + (1 - edge.front[3]) * edge.behind[c];
  }
  result.inverse_depth = 2 * edge.front[3] >= result.rgba[3] ? pair.front : pair.behind;
  result.edge = edge;
  return result;
}

}  // namespace raystage::render::depth
