// SPDX-License-Identifier: Apache-2.0
//
// Converts linear light (full scale 1) to 8-bit sRGB codes as one camera shows it: the inverse of
// its photometric response, with noise and hot pixels. Noise is a hash of its seed, so that the
// codes do not depend on threads. The cost is linear in the number of pixels.
#include "simulate/sensor_model.h"

#include <algorithm>
#include <cmath>

#include "base/half_float.h"
#include "base/transfer_function.h"
#include "simulate/hash_random.h"

namespace raystage::simulate {
namespace {

constexpr std::size_t kShownLevels = 65536;

std::vector<std::uint8_t> codes_by(const std::vector<double>& curve) {
  std::vector<std::uint8_t> codes(kShownLevels);
  for (std::size_t i = 0; i < codes.size(); ++i) {
    const double straight = srgb_from_linear(static_cast<double>(i) / (kShownLevels - 1));
    codes[i] =
        static_cast<std::uint8_t>(std::lround(255 * rig::invert_response_curve(curve, straight)));
  }
  return codes;
}

// Approximates the normal distribution (mean 0, deviation 1) by a sum of four 16-bit numbers.
float quick_normal(std::uint64_t bits) {
  const auto part = [&](unsigned shift) { return static_cast<float>((bits >> shift) & 0xFFFFU); };
  return (part(0) + part(16) + part(32) + part(48) - 131070.0F) * (1.7320508F / 65536);
}

}  // namespace

SensorModel::SensorModel(const schemas::PhotometricResponse& response, rig::PictureSize size,
                         double noise)
    : noise_(static_cast<float>(noise)),
      mixes_(response.matrix != schemas::kIdentityColorMatrix),
      hot_pixels_(response.hot_pixels) {
  const schemas::ColorMatrix unmixed = rig::inverse(response.matrix);
  for (std::size_t c = 0; c < 3; ++c) {
    gain_[c] = static_cast<float>(1 / response.contrast[c]);
    offset_[c] = static_cast<float>(-response.brightness[c]) * gain_[c];
    for (std::size_t k = 0; k < 3; ++k) {
      sensor_from_light_[c][k] = static_cast<float>(unmixed[c][k]);
    }
    if (!response.curve[c].empty()) codes_[c] = codes_by(response.curve[c]);
  }
  if (!response.vignetting && !response.gain_map) return;
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      for (const double gain : rig::gain_at(response, size, x + 0.5, y + 0.5)) {
        vignetting_.push_back(static_cast<float>(1 / gain));
      }
    }
  }
}

template <class Put>
void SensorModel::expose(const LinearImage& image, std::uint64_t noise_seed, const Put& put) const {
  auto hot = hot_pixels_.begin();
  for (std::size_t i = 0; i < image.light.size(); ++i) {
    std::array<float, 3> light{image.light[i].x(), image.light[i].y(), image.light[i].z()};
    if (mixes_) {
      const auto [r, g, b] = light;
      for (std::size_t c = 0; c < 3; ++c) {
        const auto& row = sensor_from_light_[c];
        light[c] = row[0] * r + row[1] * g + row[2] * b;
      }
    }
    const bool is_hot =
        hot != hot_pixels_.end() &&
        i == static_cast<std::size_t>(hot->y) * static_cast<std::size_t>(image.width) +
                 static_cast<std::size_t>(hot->x);
    for (std::size_t c = 0; c < 3; ++c) {
      if (!vignetting_.empty()) light[c] *= vignetting_[3 * i + c];
      float shown = light[c] * gain_[c] + offset_[c];
      if (is_hot) shown += static_cast<float>(hot->light[c]);
      if (noise_ > 0) {
        shown += noise_ * std::sqrt(std::max(shown, 0.0F)) *
                 quick_normal(splitmix64(noise_seed + 3 * i + c));
      }
      put(3 * i + c, c, shown);
    }
    if (is_hot) ++hot;
  }
}

store::RgbImage SensorModel::develop(const LinearImage& image, std::uint64_t noise_seed) const {
  static const std::vector<std::uint8_t> srgb_codes = codes_by({});
  store::RgbImage result{image.width, image.height,
                         std::vector<std::uint8_t>(image.light.size() * 3)};
  expose(image, noise_seed, [&](std::size_t at, std::size_t c, float shown) {
    const float scaled = std::clamp(shown, 0.0F, 1.0F) * (kShownLevels - 1) + 0.5F;
    const std::vector<std::uint8_t>& codes = codes_[c].empty() ? srgb_codes : codes_[c];
    result.values[at] = codes[scaled];
  });
  return result;
}

store::DeepPicture SensorModel::develop_half(const LinearImage& image,
                                             std::uint64_t noise_seed) const {
  store::DeepPicture result{image.width, image.height,
                            std::vector<std::uint16_t>(image.light.size() * 3)};
  expose(image, noise_seed, [&](std::size_t at, std::size_t /*c*/, float shown) {
    result.samples[at] = half_from_float(std::clamp(shown, -kLargestHalf, kLargestHalf));
  });
  return result;
}

store::RgbImage develop(const LinearImage& image) {
  return SensorModel({}, {image.width, image.height}, 0).develop(image);
}

}  // namespace raystage::simulate
