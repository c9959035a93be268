// SPDX-License-Identifier: Apache-2.0
// Hole filling by pull and push (Gortler, Grzeszczuk, Szeliski and Cohen 1996, section 3.4). Builds
// a pyramid of premultiplied R, G, B, A with a 4 x 4 filter, then fills pixels from the coarser
// level by 1 - alpha. Input and output: width x height x 4 floats, in place. Cost: about 4/3 passes
// each way over the pixels. Must match fill_push_pull_reference().

#include "render/common/push_pull.h"

#include <algorithm>
#include <array>
#include <vector>

#include "base/parallel.h"

namespace raystage::render {
namespace {

constexpr int kRowsPerTask = 16;

/// R, G, B, A premultiplied, row-major; borrowed.
struct PyramidLevel {
  int width = 0, height = 0;
  float* rgba = nullptr;

  float* at(int x, int y) const { return rgba + 4 * (static_cast<std::size_t>(y) * width + x); }
};

/// The two coarse pixels around a fine one along one axis; the first has weight 1 - second.
struct Between {
  int first = 0, second = 0;
  float weight_of_second = 0;
};

Between coarse_of(int fine, int coarse_size) {
  const int below = (fine - 1) >> 1;  // rounds down, also below 0
  return {std::max(below, 0), std::min(below + 1, coarse_size - 1), fine % 2 == 0 ? 0.75F : 0.25F};
}

/// Returns the weight of a fine pixel in a coarse one along one axis: the transpose of coarse_of().
float share(int fine, int coarse, int coarse_size) {
  const Between between = coarse_of(fine, coarse_size);
  return (between.first == coarse ? 1 - between.weight_of_second : 0) +
         (between.second == coarse ? between.weight_of_second : 0);
}

void pull(const PyramidLevel& fine, const PyramidLevel& coarse) {
  raystage::parallel_for_grains(0, coarse.height, kRowsPerTask, [&](int y) {
    const int y0 = std::max(2 * y - 1, 0), y1 = std::min(2 * y + 2, fine.height - 1);
    for (int x = 0; x < coarse.width; ++x) {
      const int x0 = std::max(2 * x - 1, 0), x1 = std::min(2 * x + 2, fine.width - 1);
      std::array<float, 4> across{}, sum{};
      for (int i = x0; i <= x1; ++i) across[i - x0] = share(i, x, coarse.width);
      for (int j = y0; j <= y1; ++j) {
        const float down = share(j, y, coarse.height);
        const float* from = fine.at(x0, j);
        for (int i = x0; i <= x1; ++i, from += 4) {
          const float weight = down * across[i - x0];
          for (std::size_t c = 0; c < 4; ++c) sum[c] += weight * from[c];
        }
      }
      const float scale = sum[3] > 1 ? 1 / sum[3] : sum[3] < kMinConfidence ? 0.0F : 1.0F;
      for (std::size_t c = 0; c < 4; ++c) coarse.at(x, y)[c] = sum[c] * scale;
    }
  });
}

/// Adds the coarser level to fine pixels by 1 - alpha. `empty_space`: of the pixels of the fine
/// image, or null.
void push(const PyramidLevel& coarse, const PyramidLevel& fine, const float* empty_space) {
  raystage::parallel_for_grains(0, fine.height, kRowsPerTask, [&](int y) {
    const Between rows = coarse_of(y, coarse.height);
    for (int x = 0; x < fine.width; ++x) {
      float* pixel = fine.at(x, y);
      const std::size_t at = static_cast<std::size_t>(y) * fine.width + x;
      const float whole = empty_space == nullptr ? 1 : 1 - empty_space[at];
      const float missing = whole - pixel[3];
      if (!(missing > 0)) continue;
      const Between columns = coarse_of(x, coarse.width);
      const float *upper_left = coarse.at(columns.first, rows.first),
                  *upper_right = coarse.at(columns.second, rows.first),
                  *lower_left = coarse.at(columns.first, rows.second),
                  *lower_right = coarse.at(columns.second, rows.second);
      const float right = columns.weight_of_second, lower = rows.weight_of_second;
      for (int c = 0; c < 3; ++c) {
        const float above = upper_left[c] + right * (upper_right[c] - upper_left[c]);
        const float below = lower_left[c] + right * (lower_right[c] - lower_left[c]);
        pixel[c] += missing * (above + lower * (below - above));
      }
      pixel[3] = whole;
    }
  });
}

}  // namespace

void fill_push_pull(RenderedView& view) {
  std::vector<PyramidLevel> levels{{view.width, view.height, view.rgba.data()}};
  std::vector<std::vector<float>> coarser;
  while (levels.size() == 1 || levels.back().width > 1 || levels.back().height > 1) {
    PyramidLevel next{(levels.back().width + 1) / 2, (levels.back().height + 1) / 2, nullptr};
    coarser.emplace_back(static_cast<std::size_t>(next.width) * next.height * 4);
    next.rgba = coarser.back().data();
    pull(levels.back(), next);
    levels.push_back(next);
  }
  float* mean = levels.back().rgba;
  if (mean[3] < kMinConfidence) return;  // no camera saw anything
  for (int c = 0; c < 3; ++c) mean[c] /= mean[3];
  mean[3] = 1;
  for (std::size_t i = levels.size() - 1; i > 1; --i) push(levels[i], levels[i - 1], nullptr);
  const float* empty_space = view.empty_space.empty() ? nullptr : view.empty_space.data();
  push(levels[1], levels[0], empty_space);
}

void fill_behind_edges(RenderedView& view) {
  for (EdgePixel& edge : view.edges) {
    const float* filled = &view.rgba[4 * edge.pixel];
    const float through = 1 - edge.front[3];
    const float before = edge.front[3] + through * edge.behind[3];
    constexpr float kRounding = 1e-6F;
    if (filled[3] <= before + kRounding || !(through > 0)) continue;
    for (std::size_t c = 0; c < 4; ++c) edge.behind[c] = (filled[c] - edge.front[c]) / through;
    edge.behind[3] = std::min(1.0F, edge.behind[3]);
  }
}

}  // namespace raystage::render
