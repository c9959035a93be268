// SPDX-License-Identifier: Apache-2.0
// Finds the pixels of the cameras that views of a light field frame read, from the views' tiles at
// the limits of the scene's inverse depths (1/m). Tiles are a sixteenth of the view wide, whatever
// its resolution: drafts need the depths that the final frames need. Cost: O(views x tiles x
// cameras).
#include "render/depth/estimation_regions.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>

#include "render/common/blending_field.h"
#include "render/depth/inverse_depth_map.h"

namespace raystage::render {
namespace {

constexpr int kTilesAcross = 16;
constexpr int kAlignment = 16;  // pixels: about equal views need equal parts
/// Context of the matching about the pixels that are read: a part of the camera's width.
constexpr int kMarginPerWidth = 24, kLeastMargin = 8;
/// Cameras with less weight in a tile, relative to the mean of all cameras of a ray, are left to
/// the others: they are half of all pixels, and change views by less than 0.05 dB.
constexpr float kLeastShare = 0.497F;  // not a half, which equal weights may have
/// Parts of at least this share of all pixels save too little to be worth depths of their own.
constexpr double kMostShare = 0.75;

/// Returns the view without lens distortion, kTilesAcross tiles wide or high.
VirtualCamera coarse_view(const VirtualCamera& view) {
  const VirtualCamera pinhole = undistorted(
      rig::CameraModel({"view", view.width, view.height, view.intrinsics, {}, {}, {}}), view.pose);
  constexpr double kSize = kTilesAcross * BlendingField::kTile;
  const double scale = kSize / std::max(pinhole.width, pinhole.height);
  VirtualCamera coarse = pinhole;
  coarse.width = std::max(1, static_cast<int>(std::lround(pinhole.width * scale)));
  coarse.height = std::max(1, static_cast<int>(std::lround(pinhole.height * scale)));
  const double x = static_cast<double>(coarse.width) / pinhole.width,
               y = static_cast<double>(coarse.height) / pinhole.height;
  coarse.intrinsics.fx *= x;
  coarse.intrinsics.cx *= x;
  coarse.intrinsics.fy *= y;
  coarse.intrinsics.cy *= y;
  return coarse;
}

/// The smallest rectangle about points of a camera's image; all of it if a point is behind it.
struct Bounds {
  double left = std::numeric_limits<double>::infinity(), top = left;
  double right = -left, bottom = -left;

  bool is_empty() const { return !(left <= right); }
  void add(const PixelTransfer& transfer, double x, double y, double inverse_depth) {
    const auto part = [&](std::size_t r) {
      const double* m = transfer.direction.data() + 3 * r;
      return m[0] * x + m[1] * y + m[2] + inverse_depth * transfer.parallax[r];
    };
    constexpr double kAll = 1e9;
    const double w = part(2), u = part(0) / w, v = part(1) / w;
    const bool is_in_front = w > 0 && std::isfinite(u) && std::isfinite(v);
    left = std::min(left, is_in_front ? u : -kAll);
    right = std::max(right, is_in_front ? u : kAll);
    top = std::min(top, is_in_front ? v : -kAll);
    bottom = std::max(bottom, is_in_front ? v : kAll);
  }
  /// Returns the aligned pixels with a margin, within the camera's image.
  PixelRectangle pixels(const VirtualCamera& camera) const {
    const int margin = std::max(kLeastMargin, camera.width / kMarginPerWidth);
    // Borders of aligned cameras are often whole numbers: those must not be where rounding decides.
    constexpr double kBias = 1.0 / 16;
    const auto down = [&](double value, int size) {
      const double at = std::clamp(value - margin - kBias, 0.0, static_cast<double>(size));
      return static_cast<int>(at) / kAlignment * kAlignment;
    };
    const auto up = [&](double value, int size) {
      const double at = std::clamp(value + margin + kBias, 0.0, static_cast<double>(size));
      return std::min(size, (static_cast<int>(at) / kAlignment + 1) * kAlignment);
    };
    const PixelRectangle part{down(left, camera.width), down(top, camera.height),
                              up(right, camera.width), up(bottom, camera.height)};
    return part.is_empty() ? PixelRectangle{} : part;
  }
};

/// Adds what the tiles of a view read from each camera.
void add_view(const VirtualCamera& view, const LightFieldFrame& instant,
              const InverseDepthRange& range, int cameras, std::span<const VirtualCamera> pinholes,
              std::vector<Bounds>& bounds) {
  const VirtualCamera coarse = coarse_view(view);
  const BlendingField field(coarse, *instant.rig, instant.present_cameras(), range, cameras);
  std::vector<PixelTransfer> transfers;
  for (const VirtualCamera& pinhole : pinholes) {
    transfers.push_back(pixel_transfer(pinhole, coarse));
  }
  for (const BlendingField::Tile& tile : field.tiles()) {
    for (const BlendingField::TileCamera& chosen : tile.cameras) {
      if (*std::ranges::max_element(chosen.share) < kLeastShare / static_cast<float>(cameras))
        continue;
      const PixelTransfer& transfer = transfers[static_cast<std::size_t>(chosen.camera)];
      for (const int x : {tile.left, tile.right}) {
        for (const int y : {tile.top, tile.bottom}) {
          for (const double depth : {range.farthest, range.nearest}) {
            bounds[static_cast<std::size_t>(chosen.camera)].add(transfer, x, y, depth);
          }
        }
      }
    }
  }
}

}  // namespace

bool has_region(const EstimationRegions& regions, int camera) {
  return regions.empty() || !regions[static_cast<std::size_t>(camera)].is_empty();
}

EstimationRegions needed_regions(const LightFieldFrame& instant, const schemas::DepthRange& scene,
                                 int cameras) {
  if (instant.shown_views.empty()) return {};
  std::vector<VirtualCamera> pinholes;
  for (const rig::Rig::Camera& camera : instant.rig->cameras) {
    pinholes.push_back(undistorted(camera.model, camera.pose));
  }
  std::vector<Bounds> bounds(pinholes.size());
  for (const VirtualCamera& view : instant.shown_views) {
    if (view.is_equirectangular) return {};
    const InverseDepthRange range = inverse_depth_range_in_view(view, *instant.rig, scene);
    if (!range.empty()) add_view(view, instant, range, cameras, pinholes, bounds);
  }
  EstimationRegions regions(pinholes.size());
  double needed = 0, all = 0;
  for (std::size_t i = 0; i < pinholes.size(); ++i) {
    if (!instant.is_present(static_cast<int>(i))) continue;
    all += static_cast<double>(pinholes[i].width) * pinholes[i].height;
    if (bounds[i].is_empty()) continue;
    const PixelRectangle part = bounds[i].pixels(pinholes[i]);
    regions[i] = part;
    needed += static_cast<double>(part.right - part.left) * (part.bottom - part.top);
  }
  // Views that show nothing ask for no depths.
  if (needed >= kMostShare * all || needed == 0) return {};
  return regions;
}

VirtualCamera cropped(const VirtualCamera& camera, const PixelRectangle& part) {
  VirtualCamera result = camera;
  result.width = part.right - part.left;
  result.height = part.bottom - part.top;
  result.intrinsics.cx -= part.left;
  result.intrinsics.cy -= part.top;
  return result;
}

}  // namespace raystage::render
