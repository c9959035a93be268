// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "render/common/push_pull.h"

namespace raystage {
namespace {

using Pixel = std::array<double, 4>;

struct Level {
  int width = 0, height = 0;
  std::vector<Pixel> pixels;

  Pixel& at(int x, int y) {
    return pixels[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                  static_cast<std::size_t>(x)];
  }
};

/// Calls use(x, y, weight) for the coarse pixels that a fine one lies between.
template <class Use>
void for_each_parent(int fine_x, int fine_y, const Level& coarse, const Use& use) {
  const double x = (fine_x + 0.5) / 2 - 0.5, y = (fine_y + 0.5) / 2 - 0.5;  // between centres
  for (const double near_y : {std::floor(y), std::floor(y) + 1}) {
    for (const double near_x : {std::floor(x), std::floor(x) + 1}) {
      use(std::clamp(static_cast<int>(near_x), 0, coarse.width - 1),
          std::clamp(static_cast<int>(near_y), 0, coarse.height - 1),
          (1 - std::abs(x - near_x)) * (1 - std::abs(y - near_y)));
    }
  }
}

Level opaque(Level fine) {
  if (fine.width == 1 && fine.height == 1) {
    Pixel& pixel = fine.pixels[0];
    const double confidence = pixel[3];
    for (double& value : pixel) value = confidence < kMinConfidence ? 0 : value / confidence;
    return fine;
  }
  Level coarse{(fine.width + 1) / 2, (fine.height + 1) / 2, {}};
  coarse.pixels.resize(static_cast<std::size_t>(coarse.width) *
                       static_cast<std::size_t>(coarse.height));
  for (int y = 0; y < fine.height; ++y) {
    for (int x = 0; x < fine.width; ++x) {
      for_each_parent(x, y, coarse, [&](int to_x, int to_y, double weight) {
        for (std::size_t c = 0; c < 4; ++c) {
          coarse.at(to_x, to_y)[c] += weight * fine.at(x, y)[c];
        }
      });
    }
  }
  for (Pixel& pixel : coarse.pixels) {
    const double sum = pixel[3];
    if (sum < kMinConfidence) pixel = {};
    if (sum > 1) {
      for (double& value : pixel) value /= sum;
    }
  }
  coarse = opaque(std::move(coarse));
  for (int y = 0; y < fine.height; ++y) {
    for (int x = 0; x < fine.width; ++x) {
      const double missing = 1 - fine.at(x, y)[3];
      for_each_parent(x, y, coarse, [&](int from_x, int from_y, double weight) {
        for (std::size_t c = 0; c < 4; ++c) {
          fine.at(x, y)[c] += missing * weight * coarse.at(from_x, from_y)[c];
        }
      });
    }
  }
  return fine;
}

}  // namespace

void fill_push_pull_reference(RenderedView& view) {
  Level image{view.width, view.height, std::vector<Pixel>(view.coverage.size())};
  for (std::size_t i = 0; i < view.rgba.size(); ++i) {
    image.pixels[i / 4][i % 4] = static_cast<double>(view.rgba[i]);
  }
  const Level seen = image;
  image = opaque(std::move(image));
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    const double missing = 1 - seen.pixels[i][3];
    const double empty = view.empty_space.empty() ? 0 : static_cast<double>(view.empty_space[i]);
    const double part = missing > 0 ? std::max(0.0, (missing - empty) / missing) : 0;
    for (std::size_t c = 0; c < 4; ++c) {
      const double before = seen.pixels[i][c];
      view.rgba[4 * i + c] = static_cast<float>(before + part * (image.pixels[i][c] - before));
    }
  }
}

}  // namespace raystage
