// SPDX-License-Identifier: Apache-2.0
// The light of samples of more than 8 bits. PQ and HLG: ITU-R BT.2100-2 tables 4 and 5; reference
// white: BT.2408. Matrices of primaries: SMPTE RP 177.
#include "store/pixel_light.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/half_float.h"
#include "base/transfer_function.h"
#include "rig/photometric_model.h"

namespace raystage::store {
namespace {

using Transfer = schemas::PixelEncoding::Transfer;
using Chromaticities = std::array<double, 8>;

constexpr Chromaticities kRec709{0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290};

// BT.2100 table 4, and the luminance of white in cd/m2 (BT.2408).
constexpr double kPqM1 = 2610.0 / 16384, kPqM2 = 2523.0 / 4096 * 128, kPqC1 = 3424.0 / 4096,
                 kPqC2 = 2413.0 / 4096 * 32, kPqC3 = 2392.0 / 4096 * 32;
constexpr double kPqPeak = 10000.0 / 203;

double linear_from_pq(double value) {
  const double root = std::pow(value, 1 / kPqM2);
  return kPqPeak * std::pow(std::max(0.0, root - kPqC1) / (kPqC2 - kPqC3 * root), 1 / kPqM1);
}
double pq_from_linear(double light) {
  const double root = std::pow(std::clamp(light / kPqPeak, 0.0, 1.0), kPqM1);
  return std::pow((kPqC1 + kPqC2 * root) / (1 + kPqC3 * root), kPqM2);
}

// BT.2100 table 5.
constexpr double kHlgA = 0.17883277, kHlgB = 1 - 4 * kHlgA, kHlgC = 0.55991073;

double scene_light_from_hlg(double value) {
  return value <= 0.5 ? value * value / 3 : (std::exp((value - kHlgC) / kHlgA) + kHlgB) / 12;
}
double hlg_white() { return scene_light_from_hlg(0.75); }
double linear_from_hlg(double value) { return scene_light_from_hlg(value) / hlg_white(); }
double hlg_from_linear(double light) {
  const double scene = std::clamp(light * hlg_white(), 0.0, 1.0);
  return scene <= 1.0 / 12 ? std::sqrt(3 * scene) : kHlgA * std::log(12 * scene - kHlgB) + kHlgC;
}

double linear_from_value(Transfer transfer, double value) {
  switch (transfer) {
    case Transfer::kLinear:
      return value;
    case Transfer::kSrgb:
      return linear_from_srgb(value);
    case Transfer::kPq:
      return linear_from_pq(value);
    case Transfer::kHlg:
      return linear_from_hlg(value);
  }
  return value;
}

double value_from_linear(Transfer transfer, double light) {
  switch (transfer) {
    case Transfer::kLinear:
      return light;
    case Transfer::kSrgb:
      return srgb_from_linear(light);
    case Transfer::kPq:
      return pq_from_linear(light);
    case Transfer::kHlg:
      return hlg_from_linear(light);
  }
  return light;
}

schemas::ColorMatrix multiply(const schemas::ColorMatrix& a, const schemas::ColorMatrix& b) {
  schemas::ColorMatrix product{};
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) {
      for (std::size_t k = 0; k < 3; ++k) product[i][j] += a[i][k] * b[k][j];
    }
  }
  return product;
}

/// Returns the matrix to CIE XYZ relative to white: its rows sum to white's X, Y, Z with Y = 1.
schemas::ColorMatrix xyz_from(const Chromaticities& c) {
  const auto xyz = [&](std::size_t i) {
    const double x = c[2 * i], y = std::abs(c[2 * i + 1]) < 1e-9 ? 1e-9 : c[2 * i + 1];
    return schemas::Rgb{x / y, 1, (1 - x - y) / y};
  };
  schemas::ColorMatrix primaries{};
  for (std::size_t column = 0; column < 3; ++column) {
    const schemas::Rgb of = xyz(column);
    for (std::size_t row = 0; row < 3; ++row) primaries[row][column] = of[row];
  }
  const schemas::Rgb scale = rig::multiply(rig::inverse(primaries), xyz(3));
  for (auto& row : primaries) {
    for (std::size_t column = 0; column < 3; ++column) row[column] *= scale[column];
  }
  return primaries;
}

// Bradford's cone responses: adapts the white of the source to that of Rec.709.
constexpr schemas::ColorMatrix kBradford{
    {{0.8951, 0.2664, -0.1614}, {-0.7502, 1.7135, 0.0367}, {0.0389, -0.0685, 1.0296}}};

}  // namespace

double light_from_sample(const schemas::PixelEncoding& encoding, std::uint16_t sample) {
  if (encoding.samples == schemas::PixelEncoding::Samples::kHalf) {
    return is_finite_half(sample) ? static_cast<double>(float_from_half(sample)) : 0;
  }
  const double largest = encoding.largest_code();
  return linear_from_value(encoding.transfer, std::min<double>(sample, largest) / largest);
}

std::uint16_t sample_from_light(const schemas::PixelEncoding& encoding, double light) {
  if (encoding.samples == schemas::PixelEncoding::Samples::kHalf) {
    constexpr double kMost = kLargestHalf;
    return half_from_float(static_cast<float>(std::clamp(light, -kMost, kMost)));
  }
  const double value = std::clamp(value_from_linear(encoding.transfer, light), 0.0, 1.0);
  return static_cast<std::uint16_t>(std::lround(value * encoding.largest_code()));
}

double largest_light(const schemas::PixelEncoding& encoding) {
  if (encoding.samples == schemas::PixelEncoding::Samples::kHalf) return kLargestHalf;
  return linear_from_value(encoding.transfer, 1);
}

schemas::ColorMatrix rec709_from(const schemas::PixelEncoding& encoding) {
  if (!encoding.chromaticities || *encoding.chromaticities == kRec709) {
    return schemas::kIdentityColorMatrix;
  }
  const schemas::ColorMatrix from = xyz_from(*encoding.chromaticities), to = xyz_from(kRec709);
  const auto white = [](const schemas::ColorMatrix& xyz) {
    return rig::multiply(kBradford, rig::multiply(xyz, {1, 1, 1}));
  };
  const schemas::Rgb source = white(from), target = white(to);
  schemas::ColorMatrix adapted = kBradford;
  for (std::size_t i = 0; i < 3; ++i) {
    for (double& value : adapted[i]) value *= target[i] / source[i];
  }
  return multiply(rig::inverse(to), multiply(multiply(rig::inverse(kBradford), adapted), from));
}

RgbImage codes_from_picture(const DeepPicture& picture, const schemas::PixelEncoding& encoding) {
  std::vector<float> light(kSampleValues);
  for (std::size_t i = 0; i < light.size(); ++i) {
    light[i] = static_cast<float>(light_from_sample(encoding, static_cast<std::uint16_t>(i)));
  }
  constexpr std::size_t kSteps = 4096;  // of the square root of light
  std::vector<std::uint8_t> codes(kSteps + 1);
  for (std::size_t i = 0; i < codes.size(); ++i) {
    const double root = static_cast<double>(i) / kSteps;
    codes[i] = static_cast<std::uint8_t>(std::lround(255 * srgb_from_linear(root * root)));
  }
  const schemas::ColorMatrix matrix = rec709_from(encoding);
  const bool mixes = matrix != schemas::kIdentityColorMatrix;
  std::array<std::array<float, 3>, 3> mix{};
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) mix[i][j] = static_cast<float>(matrix[i][j]);
  }
  RgbImage image(picture.width, picture.height);
  for (std::size_t i = 0; i + 3 <= image.values.size(); i += 3) {
    std::array<float, 3> rgb{};
    for (std::size_t c = 0; c < 3; ++c) rgb[c] = light[picture.samples[i + c]];
    if (mixes) {
      const auto [r, g, b] = rgb;
      for (std::size_t c = 0; c < 3; ++c) rgb[c] = mix[c][0] * r + mix[c][1] * g + mix[c][2] * b;
    }
    for (std::size_t c = 0; c < 3; ++c) {
      const float root = std::sqrt(std::clamp(rgb[c], 0.0F, 1.0F));
      image.values[i + c] = codes[static_cast<std::size_t>(root * kSteps + 0.5F)];
    }
  }
  return image;
}

}  // namespace raystage::store
