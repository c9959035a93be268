// SPDX-License-Identifier: Apache-2.0
#include "render/depth/fusion.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "render/depth/solve_kernels.h"
#include "schemas/parallel.h"

namespace raystage {
namespace {

std::size_t pixels_of(const VirtualCamera& view) {
  return static_cast<std::size_t>(view.width) * static_cast<std::size_t>(view.height);
}

/// The farthest of the known depths next along the row and the column; unknown where none is near.
float depth_behind(const InverseDepthMap& map, const std::vector<float>& share, float least_share,
                   int x, int y) {
  constexpr int kReach = 40;  // pixels
  constexpr std::array<std::array<int, 2>, 4> kWays{{{1, 0}, {-1, 0}, {0, 1}, {0, -1}}};
  float behind = kUnknownDepth;
  for (const auto& [dx, dy] : kWays) {
    for (int i = 1; i <= kReach; ++i) {
      const int column = x + i * dx, row = y + i * dy;
      if (column < 0 || row < 0 || column >= map.width || row >= map.height) break;
      const std::size_t at = static_cast<std::size_t>(row) * static_cast<std::size_t>(map.width) +
                             static_cast<std::size_t>(column);
      if (map.values[at] < 0 || share[at] < least_share) continue;
      behind = behind < 0 ? map.values[at] : std::min(behind, map.values[at]);
      break;
    }
  }
  return behind;
}

InverseDepthMap filled(const InverseDepthMap& map, const std::vector<float>& share,
                       float least_share) {
  InverseDepthMap result = map;
  raystage::parallel_for(0, map.height, [&](int y) {
    for (int x = 0; x < map.width; ++x) {
      const std::size_t at = static_cast<std::size_t>(y) * static_cast<std::size_t>(map.width) +
                             static_cast<std::size_t>(x);
      if (map.values[at] >= 0 && share[at] >= least_share) continue;
      const float behind = depth_behind(map, share, least_share, x, y);
      if (behind >= 0) result.values[at] = behind;
    }
  });
  return result;
}

/// Of nine values, by a sorting network of which only the middle is kept (Paeth 1990).
float median_of_nine(std::array<float, 9>& v) {
  const auto sort = [&](std::size_t a, std::size_t b) {
    const float low = std::min(v[a], v[b]);
    v[b] = std::max(v[a], v[b]);
    v[a] = low;
  };
  for (const auto& [a, b] : std::initializer_list<std::array<std::size_t, 2>>{{1, 2},
                                                                              {4, 5},
                                                                              {7, 8},
                                                                              {0, 1},
                                                                              {3, 4},
                                                                              {6, 7},
                                                                              {1, 2},
                                                                              {4, 5},
                                                                              {7, 8},
                                                                              {0, 3},
                                                                              {5, 8},
                                                                              {4, 7},
                                                                              {3, 6},
                                                                              {1, 4},
                                                                              {2, 5},
                                                                              {4, 7},
                                                                              {4, 2},
                                                                              {6, 4},
                                                                              {4, 2}}) {
    sort(a, b);
  }
  return v[4];
}

InverseDepthMap median(const InverseDepthMap& map) {
  InverseDepthMap result = map;
  raystage::parallel_for(0, map.height, [&](int y) {
    std::array<const float*, 3> rows;
    for (int j = 0; j < 3; ++j) {
      const int row = std::clamp(y + j - 1, 0, map.height - 1);
      rows[static_cast<std::size_t>(j)] =
          map.values.data() + static_cast<std::ptrdiff_t>(row) * map.width;
    }
    float* out = result.values.data() + static_cast<std::ptrdiff_t>(y) * map.width;
    std::array<float, 9> v;
    for (int x = 0; x < map.width; ++x) {
      const int left = std::max(x - 1, 0), right = std::min(x + 1, map.width - 1);
      for (std::size_t j = 0; j < 3; ++j) {
        v[3 * j] = rows[j][left];
        v[3 * j + 1] = rows[j][x];
        v[3 * j + 2] = rows[j][right];
      }
      out[x] = median_of_nine(v);
    }
  });
  return result;
}

}  // namespace

InverseDepthMap warp_depths(const InverseDepthMap& map, const VirtualCamera& camera,
                            const VirtualCamera& view) {
  InverseDepthMap warped{view.width, view.height, {}};
  warped.values.assign(pixels_of(view), kUnknownDepth);
  const PixelTransfer transfer = pixel_transfer(view, camera);
  std::array<float, 9> m{};
  std::array<float, 3> parallax{};
  for (std::size_t i = 0; i < 9; ++i) m[i] = static_cast<float>(transfer.direction[i]);
  for (std::size_t i = 0; i < 3; ++i) parallax[i] = static_cast<float>(transfer.parallax[i]);
  // A pixel is drawn out by the ratio of the focal lengths, and of the depths: W.
  const auto focal_ratio = static_cast<float>(std::max(view.intrinsics.fx / camera.intrinsics.fx,
                                                       view.intrinsics.fy / camera.intrinsics.fy));
  const auto width = static_cast<float>(view.width), height = static_cast<float>(view.height);
  for (int y = 0; y < map.height; ++y) {
    const float row = static_cast<float>(y) + 0.5F;
    const float base_x = m[1] * row + m[2], base_y = m[4] * row + m[5], base_w = m[7] * row + m[8];
    for (int x = 0; x < map.width; ++x) {
      const float q = map.at(x, y);
      if (q < 0) continue;
      const float column = static_cast<float>(x) + 0.5F;
      const float w = m[6] * column + base_w + q * parallax[2];
      if (!(w > 0)) continue;
      const float inverse = 1 / w;
      const float u = (m[0] * column + base_x + q * parallax[0]) * inverse;
      const float v = (m[3] * column + base_y + q * parallax[1]) * inverse;
      const float there = q * inverse;
      constexpr float kWhole = 1.25F;  // a little more than a pixel leaves few holes, a vote fills
      const float extent = focal_ratio * inverse;
      if (extent <= kWhole) {
        if (!(u >= 0 && v >= 0 && u < width && v < height)) continue;
        float& known =
            warped.values[static_cast<std::size_t>(v) * static_cast<std::size_t>(view.width) +
                          static_cast<std::size_t>(u)];
        known = std::max(known, there);
        continue;
      }
      const float half = std::min(extent, static_cast<float>(kMostFootprint)) / 2;
      if (!(u + half >= 0 && v + half >= 0 && u - half < width && v - half < height)) continue;
      const int left = std::max(0, static_cast<int>(std::lround(u - half)));
      const int right = std::min(view.width, static_cast<int>(std::lround(u + half)));
      const int top = std::max(0, static_cast<int>(std::lround(v - half)));
      const int bottom = std::min(view.height, static_cast<int>(std::lround(v + half)));
      for (int j = top; j < bottom; ++j) {
        float* out = warped.values.data() + static_cast<std::ptrdiff_t>(j) * view.width;
        for (int i = left; i < right; ++i) out[i] = std::max(out[i], there);
      }
    }
  }
  return warped;
}

InverseDepthMap fuse_depths(const VirtualCamera& view, std::span<const DepthReport> reports,
                            const FusionSettings& settings) {
  std::vector<InverseDepthMap> warped(reports.size());
  raystage::parallel_for(std::size_t{0}, reports.size(), [&](std::size_t i) {
    warped[i] = warp_depths(*reports[i].map, *reports[i].camera, view);
  });
  std::vector<float> weights;
  for (const DepthReport& report : reports) weights.push_back(report.weight);
  InverseDepthMap fused{view.width, view.height, {}};
  fused.values.resize(pixels_of(view));
  std::vector<float> share(pixels_of(view));
  raystage::parallel_for(0, view.height, [&](int y) {
    const std::size_t row = static_cast<std::size_t>(y) * static_cast<std::size_t>(view.width);
    std::vector<const float*> rows;
    for (const InverseDepthMap& map : warped) rows.push_back(map.values.data() + row);
    vote_row({rows, weights, view.width, settings.tolerance, fused.values.data() + row,
              share.data() + row});
  });
  return median(filled(fused, share, settings.least_share));
}

void smooth_along_links(std::vector<float>& values, int channels, int width, int height,
                        const PixelLinks& links) {
  const auto n = static_cast<std::ptrdiff_t>(channels);
  const std::ptrdiff_t pitch = n * width;
  const auto draw = [n](float* value, const float* towards, float link) {
    for (std::ptrdiff_t c = 0; c < n; ++c) value[c] += link * (towards[c] - value[c]);
  };
  raystage::parallel_for(0, height, [&](int y) {
    float* row = values.data() + y * pitch;
    const float* left = links.left.data() + static_cast<std::ptrdiff_t>(y) * width;
    for (int x = 1; x < width; ++x) draw(row + x * n, row + (x - 1) * n, left[x]);
    for (int x = width - 2; x >= 0; --x) draw(row + x * n, row + (x + 1) * n, left[x + 1]);
  });
  constexpr int kColumns = 64;
  raystage::parallel_for(0, (width + kColumns - 1) / kColumns, [&](int strip) {
    const int begin = strip * kColumns, end = std::min(width, begin + kColumns);
    const auto draw_row = [&](int y, int towards, const float* above) {
      for (int x = begin; x < end; ++x) {
        draw(values.data() + y * pitch + x * n, values.data() + towards * pitch + x * n, above[x]);
      }
    };
    const auto link_row = [&](int y) {
      return links.above.data() + static_cast<std::ptrdiff_t>(y) * width;
    };
    for (int y = 1; y < height; ++y) draw_row(y, y - 1, link_row(y));
    for (int y = height - 2; y >= 0; --y) draw_row(y, y + 1, link_row(y + 1));
  });
}

}  // namespace raystage
