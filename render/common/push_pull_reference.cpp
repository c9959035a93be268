// SPDX-License-Identifier: Apache-2.0
// Reference of fill_push_pull() (push_pull.cpp): hole filling by pull and push (Gortler,
// Grzeszczuk, Szeliski and Cohen 1996, section 3.4), pixel by pixel in double, level by level
// recursively. Input and output: premultiplied R, G, B, A of a view, in place. Cost: O(pixels),
// with four coarse pixels per fine pixel in each direction.
#include <algorithm>
#include <array>
#include <cmath>

#include "base/image.h"
#include "render/common/push_pull.h"

namespace raystage::render {
namespace {

using Pixel = std::array<double, 4>;

using Level = Image<Pixel>;

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
    Pixel& pixel = fine.values[0];
    const double confidence = pixel[3];
    for (double& value : pixel) value = confidence < kMinConfidence ? 0 : value / confidence;
    return fine;
  }
  Level coarse((fine.width + 1) / 2, (fine.height + 1) / 2);
  for (int y = 0; y < fine.height; ++y) {
    for (int x = 0; x < fine.width; ++x) {
      for_each_parent(x, y, coarse, [&](int to_x, int to_y, double weight) {
        for (std::size_t c = 0; c < 4; ++c) coarse.at(to_x, to_y)[c] += weight * fine.at(x, y)[c];
      });
    }
  }
  for (Pixel& pixel : coarse.values) {
    const double sum = pixel[3];
    if (sum < kMinConfidence) pixel = {};
    if (sum > 1)
      for (double& value : pixel) value /= sum;
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
  Level image(view.width, view.height);
  for (std::size_t i = 0; i < view.rgba.size(); ++i) {
    image.values[i / 4][i % 4] = static_cast<double>(view.rgba[i]);
  }
  const Level seen = image;
  image = opaque(std::move(image));
  for (std::size_t i = 0; i < image.values.size(); ++i) {
    const double missing = 1 - seen.values[i][3];
    const double empty = view.empty_space.empty() ? 0 : static_cast<double>(view.empty_space[i]);
    const double part = missing > 0 ? std::max(0.0, (missing - empty) / missing) : 0;
    for (std::size_t c = 0; c < 4; ++c) {
      const double before = seen.values[i][c];
      view.rgba[4 * i + c] = static_cast<float>(before + part * (image.values[i][c] - before));
    }
  }
}

}  // namespace raystage::render
