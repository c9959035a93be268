// SPDX-License-Identifier: Apache-2.0
// Detects a point light in a picture: subtracts the background and finds connected components of
// pixels above a quarter of the maximum. Chooses the component with the most light; its centre is
// the mean position weighted by light. Input: RGB codes; output: pixels, centres at +0.5. Cost:
// pixels of the picture.
#include "calibrate/detect/light_spot.h"

#include <algorithm>

#include "base/options.h"

namespace raystage::calibrate {
namespace {

constexpr std::uint8_t kFull = 250;  // codes: JPEG leaves clipped areas a little below 255

/// A connected component of pixels.
struct Group {
  double light = 0;
  std::size_t left = 0, right = 0, top = 0, bottom = 0;  // its bounding box
  int area = 0, full = 0;
  bool at_border = false;
};

/// Returns the connected component of a pixel above a threshold, and marks its pixels.
Group group_at(std::size_t start, const std::vector<float>& light, const store::RgbImage& picture,
               float threshold, std::vector<std::uint8_t>& taken,
               std::vector<std::size_t>& waiting) {
  const auto width = static_cast<std::size_t>(picture.width);
  const auto height = static_cast<std::size_t>(picture.height);
  Group group;
  group.left = group.right = start % width;
  group.top = group.bottom = start / width;
  waiting.assign(1, start);
  taken[start] = 1;
  while (!waiting.empty()) {
    const std::size_t at = waiting.back();
    waiting.pop_back();
    const std::size_t x = at % width, y = at / width;
    group.light += light[at];
    group.left = std::min(group.left, x);
    group.right = std::max(group.right, x);
    group.top = std::min(group.top, y);
    group.bottom = std::max(group.bottom, y);
    ++group.area;
    const std::uint8_t* rgb = &picture.values[3 * at];
    group.full += std::max({rgb[0], rgb[1], rgb[2]}) >= kFull ? 1 : 0;
    group.at_border = group.at_border || x == 0 || y == 0 || x + 1 == width || y + 1 == height;
    for (std::size_t row = y > 0 ? y - 1 : 0; row <= std::min(y + 1, height - 1); ++row) {
      for (std::size_t column = x > 0 ? x - 1 : 0; column <= std::min(x + 1, width - 1); ++column) {
        const std::size_t next = row * width + column;
        if (taken[next] != 0 || !(light[next] > threshold)) continue;
        taken[next] = 1;
        waiting.push_back(next);
      }
    }
  }
  return group;
}

/// Returns the mean position weighted by light over a component and its border. The border includes
/// pixels below a quarter of the maximum, but not noise.
Eigen::Vector2d centre_of(const Group& group, const std::vector<float>& light, float brightest,
                          int width, int height) {
  constexpr float kNoise = 0.02F;  // relative to the brightest pixel
  const auto columns = static_cast<std::size_t>(width), rows = static_cast<std::size_t>(height);
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  double weight = 0;
  for (std::size_t y = group.top > 0 ? group.top - 1 : 0; y <= std::min(group.bottom + 1, rows - 1);
       ++y) {
    for (std::size_t x = group.left > 0 ? group.left - 1 : 0;
         x <= std::min(group.right + 1, columns - 1); ++x) {
      const float here = light[y * columns + x];
      if (here < kNoise * brightest) continue;
      sum += here * Eigen::Vector2d(static_cast<double>(x) + 0.5, static_cast<double>(y) + 0.5);
      weight += here;
    }
  }
  return sum / weight;
}

}  // namespace

std::string_view name_of(LightDetectionStatus result) {
  constexpr std::array<std::string_view, kLightDetectionStatusCount> kNames{
      "found", "dark", "ambiguous", "too large", "saturated", "at the border", "unsteady"};
  return kNames[static_cast<std::size_t>(result)];
}

LightBackground::LightBackground(std::span<const store::RgbImage> pictures,
                                 const std::array<float, 256>& linear_from_code)
    : width_(pictures.front().width),
      height_(pictures.front().height),
      linear_from_code_(linear_from_code) {
  const std::size_t count = pictures.front().values.size() / 3;
  std::vector<float> of_pixel(pictures.size());
  light_.resize(count);
  const auto middle = of_pixel.begin() + of_pixel.size() / 2;
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t k = 0; k < pictures.size(); ++k) {
      of_pixel[k] = luminance(&pictures[k].values[3 * i]);
    }
    std::nth_element(of_pixel.begin(), middle, of_pixel.end());
    light_[i] = *middle;
  }
}

bool LightDetectionOptions::is_valid(std::string* reason) const {
  return is_within("light above the background", min_light, 0, 1, reason) &&
         is_within("ambiguity ratio", ambiguity_ratio, 0, 1, reason) &&
         is_within("share of the picture", max_area, 0, 1, reason) &&
         is_within("saturated share", max_saturated_share, 0, 1, reason);
}

LightSpot detect_light(const store::RgbImage& picture, const LightBackground& background,
                       const LightDetectionOptions& options) {
  const std::span<const float> behind = background.light();
  std::vector<float> light(behind.size());
  float brightest = 0;
  for (std::size_t i = 0; i < light.size(); ++i) {
    light[i] = background.luminance(&picture.values[3 * i]) - behind[i];
    brightest = std::max(brightest, light[i]);
  }
  LightSpot spot;
  if (brightest < options.min_light) return spot;
  constexpr float kGroup = 0.25F;  // relative to the brightest pixel
  const float threshold = kGroup * brightest;
  std::vector<std::uint8_t> taken(light.size(), 0);
  std::vector<std::size_t> waiting;
  Group first;
  double second = 0;
  for (std::size_t i = 0; i < light.size(); ++i) {
    if (taken[i] != 0 || !(light[i] > threshold)) continue;
    const Group group = group_at(i, light, picture, threshold, taken, waiting);
    if (group.light > first.light) {
      second = first.light;
      first = group;
    } else {
      second = std::max(second, group.light);
    }
  }
  constexpr int kSmall = 12;  // pixels: a clipped light of this size has not grown by blooming
  spot.centre = centre_of(first, light, brightest, picture.width, picture.height);
  spot.light = first.light;
  spot.area = first.area;
  const double pixels = static_cast<double>(light.size());
  if (second > options.ambiguity_ratio * first.light) {
    spot.result = LightDetectionStatus::kAmbiguous;
  } else if (first.area > std::max(options.max_area * pixels, 4.0 * kSmall)) {
    spot.result = LightDetectionStatus::kTooLarge;
  } else if (first.at_border) {
    spot.result = LightDetectionStatus::kAtBorder;
  } else if (first.area > kSmall && first.full > options.max_saturated_share * first.area) {
    spot.result = LightDetectionStatus::kSaturated;
  } else {
    spot.result = LightDetectionStatus::kFound;
  }
  return spot;
}

}  // namespace raystage::calibrate
