// SPDX-License-Identifier: Apache-2.0
// Warps a camera's inverse depth map forward to a view (splatting): each pixel is written where the
// view sees its point, over the pixels that it covers there, and the nearest surface wins. Works in
// tiles of 32 x 32 pixels of the view; blocks of the map that cannot reach a wanted tile are
// skipped. Cost: O(pixels of the map + pixels written). Must match warp_depths_reference() in
// warp_reference.cpp.
#include "render/depth/warp.h"

#include <algorithm>
#include <cmath>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/depth/warp.cpp"
// The order matters.
// clang-format off
#include <hwy/foreach_target.h>  // IWYU pragma: keep
#include <hwy/highway.h>
#include "render/depth/transfer-inl.h"
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace raystage::render {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

HWY_INLINE void put_down(const VirtualCamera& view, DepthTiles& tiles, float u, float v,
                         float extent, float inverse_depth) {
  const float half = std::min(extent, static_cast<float>(kMaxSplatSize)) / 2;
  const auto bound = [](float at, int size) HWY_ATTR {
    return static_cast<int>(std::clamp(std::round(at), 0.0F, static_cast<float>(size)));
  };
  const int left = bound(u - half, view.width), right = bound(u + half, view.width);
  const int top = bound(v - half, view.height), bottom = bound(v + half, view.height);
  const int columns = depth_tile_columns(view);
  for (int y = top; y < bottom; ++y) {
    for (int x = left; x < right; ++x) {
      const std::int32_t first =
          tiles.first[(y >> kDepthTileLog2) * columns + (x >> kDepthTileLog2)];
      if (first == 0) continue;
      float& known = tiles.values[first + (y % kDepthTile) * kDepthTile + x % kDepthTile];
      known = std::max(known, inverse_depth);
    }
  }
}

/// Warps the needed blocks. `needed`: by block of kDepthTile x kDepthTile pixels of the map.
void warp(const InverseDepthMap& map, const VirtualCamera& camera, const VirtualCamera& view,
          const std::vector<std::uint8_t>& needed, DepthTiles& tiles) {
  const hn::ScalableTag<float> d;
  const hn::RebindToSigned<decltype(d)> di;
  constexpr int kMaxLanes = static_cast<int>(hn::MaxLanes(d));
  const int lanes = static_cast<int>(hn::Lanes(d));
  const PixelTransfer transfer = pixel_transfer(view, camera);
  // The footprint of a pixel is the ratio of the focal lengths times that of the depths.
  const auto focal_ratio = static_cast<float>(std::max(view.intrinsics.fx / camera.intrinsics.fx,
                                                       view.intrinsics.fy / camera.intrinsics.fy));
  const float reach = kMaxSplatSize / 2.0F;  // points that far outside the view cover its pixels
  PixelTransfer shifted = transfer;  // shifted, so that the positions of such points are above 0
  for (std::size_t i = 0; i < 3; ++i) {
    for (const std::size_t r : {0, 1}) {
      shifted.direction[3 * r + i] += static_cast<double>(reach) * transfer.direction[6 + i];
    }
  }
  for (const std::size_t r : {0, 1}) {
    shifted.parallax[r] += static_cast<double>(reach) * transfer.parallax[2];
  }
  const auto zero = hn::Zero(d), shift = hn::Set(d, reach), ratio = hn::Set(d, focal_ratio);
  const auto one_pixel = hn::Set(d, kSinglePixelFootprint);
  const auto width = hn::Set(d, static_cast<float>(view.width));
  const auto height = hn::Set(d, static_cast<float>(view.height));
  const auto columns = hn::Set(di, depth_tile_columns(view)), within = hn::Set(di, kDepthTile - 1);
  const int blocks_per_row = (map.width + kDepthTile - 1) / kDepthTile;
  HWY_ALIGN float depth[kMaxLanes], u[kMaxLanes], v[kMaxLanes], extent[kMaxLanes];
  HWY_ALIGN std::int32_t at[kMaxLanes];
  for (int y = 0; y < map.height; ++y) {
    const RowTransfer along(shifted, y, view.width + kMaxSplatSize, view.height + kMaxSplatSize);
    const float* row = map.values.data() + static_cast<std::ptrdiff_t>(y) * map.width;
    const std::uint8_t* blocks = needed.data() + (y >> kDepthTileLog2) * blocks_per_row;
    for (int x = 0; x < map.width; x += lanes) {
      if (blocks[x >> kDepthTileLog2] == 0) continue;
      const int n = std::min(lanes, map.width - x);
      auto q = hn::Set(d, kUnknownDepth);
      if (n == lanes) {
        q = hn::LoadU(d, row + x);
      } else {
        hn::Store(q, d, depth);
        std::copy_n(row + x, n, depth);
        q = hn::Load(d, depth);
      }
      const auto known = hn::Ge(q, zero);
      const auto place = along.at(d, x, hn::Max(q, zero));
      const auto reaches = hn::And(known, place.inside);
      if (hn::AllFalse(d, reaches)) continue;
      const auto left = hn::Sub(place.u, shift), top = hn::Sub(place.v, shift);
      // The ratio of the depths is (q / W) / q = 1 / W; the latter is defined at infinity too.
      const auto covers = hn::Mul(ratio, place.per_w);
      if (HWY_UNLIKELY(!hn::AllFalse(d, hn::And(reaches, hn::Gt(covers, one_pixel))))) {
        hn::Store(left, d, u);
        hn::Store(top, d, v);
        hn::Store(covers, d, extent);
        hn::Store(hn::IfThenElse(reaches, place.inverse_depth, hn::Set(d, kUnknownDepth)), d,
                  depth);
        for (int i = 0; i < n; ++i) {
          if (depth[i] < 0) continue;
          if (extent[i] > kSinglePixelFootprint) {
            put_down(view, tiles, u[i], v[i], extent[i], depth[i]);
          } else if (u[i] >= 0 && v[i] >= 0) {
            put_down(view, tiles, std::floor(u[i]) + 0.5F, std::floor(v[i]) + 0.5F, 1, depth[i]);
          }
        }
        continue;
      }
      const auto seen = hn::And(reaches, hn::And(hn::And(hn::Ge(left, zero), hn::Lt(left, width)),
                                                 hn::And(hn::Ge(top, zero), hn::Lt(top, height))));
      const auto column = hn::ConvertTo(di, hn::IfThenElseZero(seen, left));
      const auto line = hn::ConvertTo(di, hn::IfThenElseZero(seen, top));
      const auto tile = hn::Add(hn::Mul(hn::ShiftRight<kDepthTileLog2>(line), columns),
                                hn::ShiftRight<kDepthTileLog2>(column));
      const auto first = hn::IfThenElseZero(hn::RebindMask(di, seen),
                                            hn::GatherIndex(di, tiles.first.data(), tile));
      if (hn::AllTrue(di, hn::Eq(first, hn::Zero(di)))) continue;
      hn::Store(hn::Add(first, hn::Add(hn::ShiftLeft<kDepthTileLog2>(hn::And(line, within)),
                                       hn::And(column, within))),
                di, at);
      hn::Store(place.inverse_depth, d, depth);
      for (int i = 0; i < lanes; ++i) {
        float& there = tiles.values[at[i]];
        there = std::max(there, depth[i]);
      }
    }
  }
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace raystage::render
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace raystage::render {

HWY_EXPORT(warp);

int depth_tile_columns(const VirtualCamera& view) {
  return (view.width + kDepthTile - 1) / kDepthTile;
}

std::size_t depth_tile_count(const VirtualCamera& view) {
  return static_cast<std::size_t>(depth_tile_columns(view)) *
         ((view.height + kDepthTile - 1) / kDepthTile);
}

namespace {

/// Selects the blocks of kDepthTile x kDepthTile pixels of a map that can reach wanted tiles. A
/// point lies between infinity and the nearest depth of its block, so the block's corners at these
/// depths bound its position.
class BlockChoice {
 public:
  BlockChoice(const VirtualCamera& camera, const VirtualCamera& view,
              std::span<const std::uint8_t> wanted)
      : transfer_(pixel_transfer(view, camera)), view_(view), wanted_(wanted) {}

  bool may_come_down(int left, int top, int right, int bottom, double nearest) const {
    double u0 = view_.width, u1 = 0, v0 = view_.height, v1 = 0;
    for (int i = 0; i < 8; ++i) {
      const double x = (i & 1) != 0 ? right : left, y = (i & 2) != 0 ? bottom : top;
      const double q = (i & 4) != 0 ? nearest : 0;
      const auto part = [&](std::size_t r) {
        const double* m = transfer_.direction.data() + 3 * r;
        return m[0] * x + m[1] * y + m[2] + q * transfer_.parallax[r];
      };
      const double w = part(2);
      if (!(w > 0)) return true;
      u0 = std::min(u0, part(0) / w);
      u1 = std::max(u1, part(0) / w);
      v0 = std::min(v0, part(1) / w);
      v1 = std::max(v1, part(1) / w);
    }
    constexpr double kMargin = kMaxSplatSize / 2.0 + 1;
    const auto tile = [](double at, int size) {
      return static_cast<int>(std::clamp(at, 0.0, size - 1.0)) >> kDepthTileLog2;
    };
    if (u1 < -kMargin || v1 < -kMargin || u0 > view_.width + kMargin ||
        v0 > view_.height + kMargin) {
      return false;
    }
    const int columns = depth_tile_columns(view_);
    for (int row = tile(v0 - kMargin, view_.height); row <= tile(v1 + kMargin, view_.height);
         ++row) {
      for (int column = tile(u0 - kMargin, view_.width); column <= tile(u1 + kMargin, view_.width);
           ++column) {
        if (wanted_[row * columns + column] != 0) return true;
      }
    }
    return false;
  }

 private:
  PixelTransfer transfer_;
  const VirtualCamera& view_;
  std::span<const std::uint8_t> wanted_;
};

std::vector<std::uint8_t> needed_blocks(const InverseDepthMap& map, const InverseDepthMap* nearest,
                                        const BlockChoice& choice) {
  std::vector<std::uint8_t> needed;
  for (int top = 0; top < map.height; top += kDepthTile) {
    for (int left = 0; left < map.width; left += kDepthTile) {
      if (nearest == nullptr) {
        needed.push_back(1);
        continue;
      }
      const int right = std::min(left + kDepthTile, map.width);
      const int bottom = std::min(top + kDepthTile, map.height);
      float most = kUnknownDepth;
      for (int y = top; y < bottom; y += kVisibilityBlock) {
        for (int x = left; x < right; x += kVisibilityBlock) {
          most = std::max(most, nearest->at(x >> kVisibilityBlockLog2, y >> kVisibilityBlockLog2));
        }
      }
      const bool may =
          most >= 0 && choice.may_come_down(left, top, right, bottom, static_cast<double>(most));
      needed.push_back(may ? 1 : 0);
    }
  }
  return needed;
}

}  // namespace

DepthTiles warp_depths(const InverseDepthMap& map, const VirtualCamera& camera,
                       const VirtualCamera& view, std::span<const std::uint8_t> wanted,
                       const InverseDepthMap* nearest) {
  constexpr std::int32_t kPixels = kDepthTile * kDepthTile;
  DepthTiles tiles;
  tiles.first.resize(wanted.size());
  std::int32_t count = 1;
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    if (wanted[i] != 0) tiles.first[i] = kPixels * count++;
  }
  tiles.values.assign(static_cast<std::size_t>(count) * kPixels, kUnknownDepth);
  if (count == 1) return tiles;
  const auto needed = needed_blocks(map, nearest, BlockChoice(camera, view, wanted));
  HWY_DYNAMIC_DISPATCH(warp)(map, camera, view, needed, tiles);
  return tiles;
}

}  // namespace raystage::render
#endif
