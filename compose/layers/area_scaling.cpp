// SPDX-License-Identifier: Apache-2.0
// Scales images down by area means, separably: a pixel of the result covers a span of rows and of
// columns, whose first and last pixel count by the part that it covers. Cost: linear in the pixels
// of the source.
#include "compose/layers/area_scaling.h"

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

namespace raystage::compose {
namespace {

/// Source pixels along one axis that a pixel of the smaller image covers, with their weights.
struct CoveredPixels {
  std::size_t first = 0;
  std::vector<float> weight;
};

std::vector<CoveredPixels> covered_pixels(int from, int to) {
  std::vector<CoveredPixels> result;
  const double scale = static_cast<double>(from) / to;
  for (int i = 0; i < to; ++i) {
    const double begin = i * scale, end = std::min<double>((i + 1) * scale, from);
    CoveredPixels covered{static_cast<std::size_t>(begin), {}};
    for (int p = static_cast<int>(begin); p < end; ++p) {
      const double share = std::min<double>(p + 1, end) - std::max<double>(p, begin);
      covered.weight.push_back(static_cast<float>(share / scale));
    }
    result.push_back(std::move(covered));
  }
  return result;
}

}  // namespace

void scale_down_rgba(std::span<const float> rgba, ImageSize size, ImageSize scaled,
                     std::span<float> result) {
  const std::vector<CoveredPixels> columns = covered_pixels(size.width, scaled.width);
  const std::vector<CoveredPixels> rows = covered_pixels(size.height, scaled.height);
  auto to = result.begin();
  for (const CoveredPixels& row : rows) {
    for (const CoveredPixels& column : columns) {
      std::array<float, 4> sum{};
      for (std::size_t j = 0; j < row.weight.size(); ++j) {
        const std::size_t line = (row.first + j) * static_cast<std::size_t>(size.width);
        for (std::size_t i = 0; i < column.weight.size(); ++i) {
          const std::size_t at = (line + column.first + i) * 4;
          const float weight = row.weight[j] * column.weight[i];
          for (std::size_t c = 0; c < 4; ++c) sum[c] += weight * rgba[at + c];
        }
      }
      to = std::ranges::copy(sum, to).out;
    }
  }
}

LayerImage scale_down(const LayerImage& image, ImageSize scaled) {
  LayerImage result = transparent_layer_image(scaled.width, scaled.height);
  scale_down_rgba(image.rgba, {image.width, image.height}, scaled, result.rgba);
  const auto centre = [](int i, int to, int from) {
    return static_cast<std::size_t>((i + 0.5) * from / to);
  };
  for (int y = 0; y < scaled.height; ++y) {
    const std::size_t line =
        centre(y, scaled.height, image.height) * static_cast<std::size_t>(image.width);
    for (int x = 0; x < scaled.width; ++x) {
      result.z[static_cast<std::size_t>(y) * scaled.width + x] =
          image.z[line + centre(x, scaled.width, image.width)];
    }
  }
  return result;
}

}  // namespace raystage::compose
