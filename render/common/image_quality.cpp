// SPDX-License-Identifier: Apache-2.0
// PSNR and SSIM (Wang, Bovik, Sheikh, Simoncelli 2004) of 8-bit sRGB images over covered pixels.
// SSIM uses a separable Gaussian window of 11 pixels, normalised over covered pixels, per channel.
// Cost: 11 operations per pixel, axis, channel and moment.

#include "render/common/image_quality.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string>

#include "base/error.h"
#include "base/transfer_function.h"

namespace raystage::render {
namespace {

constexpr int kRadius = 5;  // of SSIM's window

std::array<double, 2 * kRadius + 1> gaussian_window() {
  std::array<double, 2 * kRadius + 1> window{};
  for (int i = -kRadius; i <= kRadius; ++i) {
    window[i + kRadius] = std::exp(-i * i / (2 * 1.5 * 1.5));
  }
  return window;
}

/// Smooths a plane with the window, rows then columns, without weights outside the image.
std::vector<double> smooth(const std::vector<double>& plane, int width, int height) {
  static constexpr int kTaps = 2 * kRadius + 1;
  const auto window = gaussian_window();
  const auto pass = [&](const std::vector<double>& in, int length, std::ptrdiff_t step, int lines,
                        std::ptrdiff_t line_step) {
    std::vector<double> out(in.size());
    for (int line = 0; line < lines; ++line) {
      for (int i = 0; i < length; ++i) {
        double sum = 0;
        for (int t = std::max(0, kRadius - i); t < std::min(kTaps, length - i + kRadius); ++t) {
          const std::ptrdiff_t at = line * line_step + (i + t - kRadius) * step;
          sum += window[t] * in[at];
        }
        out[line * line_step + i * step] = sum;
      }
    }
    return out;
  };
  return pass(pass(plane, width, 1, height, width), height, width, width, 1);
}

struct Planes {
  int width, height;
  const std::vector<double>& counts;   // 1 where covered
  const std::vector<double>& weights;  // counts, smoothed
};

double channel_ssim(const store::RgbImage& image, const store::RgbImage& truth, std::size_t channel,
                    const Planes& planes) {
  const std::size_t pixels = planes.counts.size();
  std::array<std::vector<double>, 5> moments;  // x, y, xx, yy, xy
  for (auto& moment : moments) moment.resize(pixels);
  for (std::size_t i = 0; i < pixels; ++i) {
    const double x = image.values[i * 3 + channel], y = truth.values[i * 3 + channel];
    const std::array<double, 5> values{x, y, x * x, y * y, x * y};
    for (std::size_t m = 0; m < 5; ++m) moments[m][i] = values[m] * planes.counts[i];
  }
  for (auto& moment : moments) moment = smooth(moment, planes.width, planes.height);
  constexpr double kC1 = (0.01 * 255) * (0.01 * 255), kC2 = (0.03 * 255) * (0.03 * 255);
  double sum = 0, count = 0;
  for (std::size_t i = 0; i < pixels; ++i) {
    if (planes.counts[i] == 0) continue;
    const double w = planes.weights[i];
    const double mx = moments[0][i] / w, my = moments[1][i] / w;
    const double vx = moments[2][i] / w - mx * mx, vy = moments[3][i] / w - my * my;
    const double covariance = moments[4][i] / w - mx * my;
    sum += (2 * mx * my + kC1) * (2 * covariance + kC2) /
           ((mx * mx + my * my + kC1) * (vx + vy + kC2));
    ++count;
  }
  return sum / count;
}

}  // namespace

store::RgbImage srgb_image(const RenderedView& view) {
  store::RgbImage image{view.width, view.height, std::vector<std::uint8_t>()};
  const std::size_t pixels = view.coverage.size();
  image.values.resize(pixels * 3);
  for (std::size_t i = 0; i < pixels; ++i) {
    const float alpha = view.rgba[i * 4 + 3];
    if (!(alpha > 0)) continue;
    for (std::size_t c = 0; c < 3; ++c) {
      const double linear = static_cast<double>(view.rgba[i * 4 + c]) / static_cast<double>(alpha);
      const double code = std::clamp(srgb_from_linear(linear), 0.0, 1.0);
      image.values[i * 3 + c] = static_cast<std::uint8_t>(code * 255 + 0.5);
    }
  }
  return image;
}

std::vector<std::uint8_t> coverage_mask(const RenderedView& view) {
  std::vector<std::uint8_t> covered(view.coverage.size());
  for (std::size_t i = 0; i < covered.size(); ++i) {
    covered[i] = view.rgba[i * 4 + 3] >= 0.999F ? 1 : 0;
  }
  return covered;
}

ImageQuality compare_images(const store::RgbImage& image, const store::RgbImage& truth,
                            std::span<const std::uint8_t> covered) {
  if (image.width != truth.width || image.height != truth.height ||
      image.values.size() != truth.values.size() || covered.size() * 3 != image.values.size()) {
    throw Error::bad_input("the images differ in size: " + std::to_string(image.width) + "x" +
                               std::to_string(image.height) + " and " +
                               std::to_string(truth.width) + "x" + std::to_string(truth.height),
                           "", "Compare images of one size");
  }
  std::vector<double> counts(covered.begin(), covered.end());
  double squares = 0, count = 0;
  for (std::size_t i = 0; i < counts.size(); ++i) {
    if (counts[i] == 0) continue;
    ++count;
    for (std::size_t c = 0; c < 3; ++c) {
      const double difference = static_cast<double>(image.values[i * 3 + c]) -
                                static_cast<double>(truth.values[i * 3 + c]);
      squares += difference * difference;
    }
  }
  ImageQuality quality;
  quality.covered = counts.empty() ? 0 : count / static_cast<double>(counts.size());
  if (count == 0) {
    quality.psnr_db = quality.ssim = std::numeric_limits<double>::quiet_NaN();
    return quality;
  }
  quality.psnr_db = 10 * std::log10(255 * 255 / (squares / (3 * count)));
  const std::vector<double> weights = smooth(counts, image.width, image.height);
  const Planes planes{image.width, image.height, counts, weights};
  for (std::size_t c = 0; c < 3; ++c) quality.ssim += channel_ssim(image, truth, c, planes) / 3;
  return quality;
}

}  // namespace raystage::render
