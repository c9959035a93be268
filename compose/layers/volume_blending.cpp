// SPDX-License-Identifier: Apache-2.0
// Blends the views of takes around a volume by ray direction (thesis 7: immersive environments from
// slabs around a box). A ray takes the take with the nearest mean viewing direction; transitions
// are linear over kBlendWidthDegrees. Rays that this take did not see fall through to the next.
// Input and output: premultiplied images of one size. Cost: pixels x takes x log(takes).
#include "compose/layers/volume_blending.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <numbers>
#include <numeric>
#include <utility>

#include "base/parallel.h"

namespace raystage::compose {
namespace {

using Eigen::Vector3d;

/// Calls `body` with a VolumeBlender for the ray of each pixel.
template <class Body>
void for_rays(const render::VirtualCamera& camera, std::span<const Vector3d> view_directions,
              const Body& body) {
  parallel_for(tbb::blocked_range<int>(0, camera.height), [&](const tbb::blocked_range<int>& rows) {
    VolumeBlender blender(view_directions);
    std::vector<std::array<float, 4>> seen(view_directions.size());
    for (int y = rows.begin(); y < rows.end(); ++y) {
      for (int x = 0; x < camera.width; ++x) {
        blender.find(render::pixel_ray(camera, x + 0.5, y + 0.5).direction);
        body(blender, seen, static_cast<std::size_t>(y) * camera.width + x);
      }
    }
  });
}

/// Returns a transparent image with the takes' AOVs and notes.
LayerImage empty_like(std::span<const LayerImage* const> takes, int width, int height) {
  LayerImage image = transparent_layer_image(width, height);
  for (const LayerImage* take : takes) {
    if (take == nullptr) continue;
    render::add_notes(take->notes, image.notes);
    if (!image.aovs.empty()) continue;
    for (const Aov& aov : take->aovs) {
      image.aovs.push_back({aov.layer, aov.channels, aov.is_colour, aov.empty_value, {}});
      image.aovs.back().values.assign(aov.values.size(), aov.empty_value);
    }
  }
  return image;
}

}  // namespace

VolumeBlender::VolumeBlender(std::span<const Vector3d> view_directions)
    : view_directions_(view_directions),
      degrees_(view_directions.size()),
      nearest_(view_directions.size()),
      weights_(view_directions.size()) {}

void VolumeBlender::find(const Vector3d& direction) {
  for (std::size_t i = 0; i < view_directions_.size(); ++i) {
    // atan2 is exact also for small angles.
    const double across = view_directions_[i].cross(direction).norm();
    degrees_[i] = std::atan2(across, view_directions_[i].dot(direction)) * 180 / std::numbers::pi;
  }
  std::iota(nearest_.begin(), nearest_.end(), std::size_t{0});
  // Not stable_sort(), which allocates; the pair keeps the order of equal angles.
  std::ranges::sort(nearest_, {}, [&](std::size_t i) { return std::pair(degrees_[i], i); });
  const double least = degrees_[nearest_.front()];
  double sum = 0;
  for (std::size_t i = 0; i < view_directions_.size(); ++i) {
    const double share = std::max(0.0, 1 - (degrees_[i] - least) / kBlendWidthDegrees);
    weights_[i] = static_cast<float>(share);
    sum += share;
  }
  for (float& share : weights_) share = static_cast<float>(static_cast<double>(share) / sum);
}

std::array<float, 4> VolumeBlender::blend(std::span<const std::array<float, 4>> seen) const {
  // Takes that share a ray show the same point: those that saw it get the full weight.
  std::array<float, 4> result{};
  float counted = 0, alpha = 0;
  for (std::size_t i = 0; i < seen.size(); ++i) {
    if (weights_[i] <= 0 || seen[i][3] <= 0) continue;
    for (std::size_t c = 0; c < 4; ++c) result[c] += weights_[i] * seen[i][c];
    counted += weights_[i] * seen[i][3];
    alpha = std::max(alpha, seen[i][3]);
  }
  if (counted > 0) {
    for (float& value : result) value *= alpha / counted;
    result[3] = alpha;  // exact: opaque pixels need no other take
  }
  for (const std::size_t i : nearest_) {
    if (result[3] >= 1) break;
    if (weights_[i] > 0) continue;
    const float room = 1 - result[3];
    for (std::size_t c = 0; c < 4; ++c) result[c] += room * seen[i][c];
  }
  return result;
}

std::size_t VolumeBlender::dominant_take(std::span<const std::array<float, 4>> seen) const {
  std::size_t best = nearest_.front();
  float most = 0;
  for (const std::size_t i : nearest_) {
    const float shown = weights_[i] * seen[i][3];
    if (shown <= most) continue;
    most = shown;
    best = i;
  }
  if (most > 0) return best;
  const auto next = std::ranges::find_if(nearest_, [&](std::size_t i) { return seen[i][3] > 0; });
  return next == nearest_.end() ? best : *next;
}

std::vector<bool> takes_in_view(std::span<const Vector3d> view_directions,
                                const render::VirtualCamera& camera) {
  std::vector<std::atomic<bool>> found(view_directions.size());
  for_rays(camera, view_directions, [&](const VolumeBlender& blender, auto&, std::size_t) {
    for (std::size_t i = 0; i < found.size(); ++i) {
      if (blender.weights()[i] > 0 && !found[i].load(std::memory_order_relaxed)) found[i] = true;
    }
  });
  return {found.begin(), found.end()};
}

LayerImage blend_volume(std::span<const LayerImage* const> takes,
                        std::span<const Vector3d> view_directions,
                        const render::VirtualCamera& camera) {
  LayerImage image = empty_like(takes, camera.width, camera.height);
  for_rays(camera, view_directions,
           [&](const VolumeBlender& blender, auto& seen, std::size_t pixel) {
             for (std::size_t i = 0; i < takes.size(); ++i) {
               seen[i] = {};
               if (takes[i] != nullptr) std::copy_n(&takes[i]->rgba[4 * pixel], 4, seen[i].begin());
             }
             const std::array<float, 4> shown = blender.blend(seen);
             std::ranges::copy(shown, &image.rgba[4 * pixel]);
             const LayerImage* dominant_take = takes[blender.dominant_take(seen)];
             if (shown[3] <= 0 || dominant_take == nullptr) return;
             image.z[pixel] = dominant_take->z[pixel];
             for (std::size_t a = 0; a < image.aovs.size(); ++a) {
               const std::size_t width = image.aovs[a].channels.size();
               std::copy_n(&dominant_take->aovs[a].values[width * pixel], width,
                           &image.aovs[a].values[width * pixel]);
             }
           });
  return image;
}

}  // namespace raystage::compose
