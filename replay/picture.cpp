// SPDX-License-Identifier: Apache-2.0
// Converts rendered views to pictures for a display, row by row in parallel. Input: scene-linear
// R, G, B, A, depth in metres and coverage; output: 8-bit R, G, B. Depth is shown in false colours,
// linear in inverse depth, as the precision of a light field is. Cost: linear in pixels.
#include "replay/picture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <string_view>
#include <vector>

#include "base/parallel.h"

namespace raystage::replay {
namespace {

using Channel = schemas::ViewerMessage::Look::Channel;

/// Returns the values of an AOV of light fields; empty if the image has none.
std::span<const float> light_field_aov(const compose::LayerImage& image, std::string_view channel) {
  for (const compose::Aov& aov : image.aovs) {
    if (aov.layer == "lf" && aov.channels.front() == channel) return aov.values;
  }
  return {};
}

/// Returns whether a pixel and the next ones are opaque: what is behind them is not in focus.
bool is_opaque_around(const compose::LayerImage& image, int x, int y) {
  constexpr float kOpaque = 0.99F;
  const auto is_opaque = [&](int column, int row) {
    const auto at = static_cast<std::size_t>(std::clamp(row, 0, image.height - 1)) * image.width +
                    std::clamp(column, 0, image.width - 1);
    return image.rgba[4 * at + 3] > kOpaque;
  };
  return is_opaque(x, y) && is_opaque(x - 1, y) && is_opaque(x + 1, y) && is_opaque(x, y - 1) &&
         is_opaque(x, y + 1);
}

std::uint8_t code_of_share(float share) {
  return static_cast<std::uint8_t>(std::lround(255 * std::clamp(share, 0.0F, 1.0F)));
}

/// Returns a part of values that may be empty.
std::span<const float> row_of(std::span<const float> values, std::size_t first, std::size_t count) {
  return values.empty() ? values : values.subspan(first, count);
}

void show_share(std::span<const float> values, std::size_t stride, std::span<std::uint8_t> codes) {
  for (std::size_t x = 0; x < codes.size() / 3; ++x) {
    const float value = x * stride < values.size() ? values[x * stride] : 0.0F;
    std::fill_n(&codes[3 * x], 3, code_of_share(value));
  }
}

}  // namespace

compose::DisplayOptions display_options(const schemas::ViewerMessage::Look& look,
                                        const compose::ShotColorSpaces& colors) {
  compose::DisplayOptions options;
  options.exposure = look.exposure;
  options.background = look.black ? compose::Background::kBlack : compose::Background::kChecker;
  options.colors = colors.studio;
  options.monitor = look.display;
  options.view = look.view;
  return options;
}

PictureMaker::PictureMaker(const schemas::ViewerMessage::Look& look,
                           const compose::ShotColorSpaces& colors)
    : look_(look), display_(display_options(look, colors), colors.interop_id, colors.space) {}

store::RgbImage PictureMaker::make(const compose::LayerImage& image) const {
  store::RgbImage picture(image.width, image.height);
  const compose::InverseDepthSpan span = look_.channel == Channel::kDepth
                                             ? compose::inverse_depth_span(image.z)
                                             : compose::InverseDepthSpan{};
  const std::span<const float> coverage = light_field_aov(image, "coverage");
  const std::span<const float> confidence = light_field_aov(image, "confidence");
  const auto width = static_cast<std::size_t>(image.width);
  constexpr int kRowsOfTask = 8;
  parallel_for_grains(0, image.height, kRowsOfTask, [&](int y) {
    const std::size_t first = y * width;
    const std::span<const float> rgba = std::span(image.rgba).subspan(4 * first, 4 * width);
    switch (look_.channel) {
      case Channel::kColor:
        display_.apply_row(rgba, y, picture.row(y));
        break;
      case Channel::kAlpha:
        show_share(rgba.subspan(3), 4, picture.row(y));
        break;
      case Channel::kDepth:
        compose::show_depth(std::span(image.z).subspan(first, width), span, picture.row(y));
        break;
      case Channel::kCoverage:
        show_share(row_of(coverage, first, width), 1, picture.row(y));
        break;
      case Channel::kConfidence:
        show_share(row_of(confidence, first, width), 1, picture.row(y));
        break;
    }
  });
  if (look_.peaking) mark_sharp_edges(image, picture);
  return picture;
}

void mark_sharp_edges(const compose::LayerImage& image, store::RgbImage& picture) {
  constexpr int kThreshold = 30;  // codes of 8 bits, sum of both directions
  const store::RgbImage seen = picture;
  const auto green = [&](int x, int y) { return static_cast<int>(seen.clamped(x, y, 1)); };
  constexpr int kRowsOfTask = 8;
  parallel_for_grains(0, picture.height, kRowsOfTask, [&](int y) {
    for (int x = 0; x < picture.width; ++x) {
      // The second difference: large at sharp edges, small at blurred ones.
      const int across = std::abs(2 * green(x, y) - green(x - 1, y) - green(x + 1, y));
      const int down = std::abs(2 * green(x, y) - green(x, y - 1) - green(x, y + 1));
      if (across + down < kThreshold || !is_opaque_around(image, x, y)) continue;
      const auto pixel = picture.pixel(x, y);
      pixel[0] = 255;
      pixel[1] = 32;
      pixel[2] = 32;
    }
  });
}

}  // namespace raystage::replay
