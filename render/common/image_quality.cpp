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

/// The factors of the structural similarity at each pixel; 0 where it is not covered.
struct Similarity {
  std::vector<double> luminance, contrast;
};

/// `x`, `y`: a channel of the two images, codes.
Similarity similarity(const std::vector<double>& x, const std::vector<double>& y,
                      const Planes& planes) {
  const std::size_t pixels = planes.counts.size();
  std::array<std::vector<double>, 5> moments;  // x, y, xx, yy, xy
  for (auto& moment : moments) moment.resize(pixels);
  for (std::size_t i = 0; i < pixels; ++i) {
    const std::array<double, 5> values{x[i], y[i], x[i] * x[i], y[i] * y[i], x[i] * y[i]};
    for (std::size_t m = 0; m < 5; ++m) moments[m][i] = values[m] * planes.counts[i];
  }
  for (auto& moment : moments) moment = smooth(moment, planes.width, planes.height);
  constexpr double kC1 = (0.01 * 255) * (0.01 * 255), kC2 = (0.03 * 255) * (0.03 * 255);
  Similarity found{std::vector<double>(pixels, 0), std::vector<double>(pixels, 0)};
  for (std::size_t i = 0; i < pixels; ++i) {
    if (planes.counts[i] == 0) continue;
    const double w = planes.weights[i];
    const double mx = moments[0][i] / w, my = moments[1][i] / w;
    const double vx = moments[2][i] / w - mx * mx, vy = moments[3][i] / w - my * my;
    const double covariance = moments[4][i] / w - mx * my;
    found.luminance[i] = (2 * mx * my + kC1) / (mx * mx + my * my + kC1);
    found.contrast[i] = (2 * covariance + kC2) / (vx + vy + kC2);
  }
  return found;
}

std::vector<double> channel_of(const store::RgbImage& image, std::size_t channel) {
  std::vector<double> values(image.values.size() / 3);
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = image.values[i * 3 + channel];
  return values;
}

double channel_ssim(const store::RgbImage& image, const store::RgbImage& truth, std::size_t channel,
                    const Planes& planes) {
  const Similarity found =
      similarity(channel_of(image, channel), channel_of(truth, channel), planes);
  double sum = 0, count = 0;
  for (std::size_t i = 0; i < planes.counts.size(); ++i) {
    sum += found.luminance[i] * found.contrast[i];
    count += planes.counts[i];
  }
  return sum / count;
}

/// One scale of multi_scale_ssim().
struct Scale {
  int width = 0, height = 0;
  std::vector<double> counts, mask;  // 1 or 0
  std::array<std::vector<double>, 3> image, truth;

  /// Returns this at half the size: means of 2 x 2 pixels. An odd last row or column
  /// counts twice.
  Scale halved() const {
    Scale half{(width + 1) / 2, (height + 1) / 2, {}, {}, {}, {}};
    const auto combine = [&](const std::vector<double>& from, const auto& reduce) {
      std::vector<double> to;
      const auto at = [&](int x, int y) {
        const auto column = static_cast<std::size_t>(std::min(x, width - 1));
        const auto row = static_cast<std::size_t>(std::min(y, height - 1));
        return from[row * static_cast<std::size_t>(width) + column];
      };
      for (int y = 0; y < height; y += 2) {
        for (int x = 0; x < width; x += 2) {
          to.push_back(reduce(at(x, y), at(x + 1, y), at(x, y + 1), at(x + 1, y + 1)));
        }
      }
      return to;
    };
    const auto mean = [](double a, double b, double c, double d) { return (a + b + c + d) / 4; };
    half.counts = combine(counts, [](double a, double b, double c, double d) {
      return std::min({a, b, c, d});
    });
    half.mask = combine(mask, [](double a, double b, double c, double d) {
      return std::max({a, b, c, d});
    });
    for (std::size_t i = 0; i < 3; ++i) {
      half.image[i] = combine(image[i], mean);
      half.truth[i] = combine(truth[i], mean);
    }
    return half;
  }

  /// Returns the mean contrast over the covered pixels of the mask, times luminance if that counts.
  double mean_similarity(std::size_t channel, bool with_luminance) const {
    const std::vector<double> weights = smooth(counts, width, height);
    const Similarity found =
        similarity(image[channel], truth[channel], {width, height, counts, weights});
    double sum = 0, count = 0;
    for (std::size_t i = 0; i < counts.size(); ++i) {
      if (counts[i] * mask[i] == 0) continue;
      sum += found.contrast[i] * (with_luminance ? found.luminance[i] : 1);
      ++count;
    }
    return count > 0 ? sum / count : std::numeric_limits<double>::quiet_NaN();
  }
};

void require_equal_sizes(const store::RgbImage& image, const store::RgbImage& truth,
                         std::size_t pixels) {
  if (image.width == truth.width && image.height == truth.height &&
      image.values.size() == truth.values.size() && pixels * 3 == image.values.size()) {
    return;
  }
  throw Error::bad_input("the images differ in size: " + std::to_string(image.width) + "x" +
                             std::to_string(image.height) + " and " + std::to_string(truth.width) +
                             "x" + std::to_string(truth.height),
                         "", "Compare images of one size");
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
  require_equal_sizes(image, truth, covered.size());
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

double multi_scale_ssim(const store::RgbImage& image, const store::RgbImage& truth,
                        std::span<const std::uint8_t> covered, std::span<const std::uint8_t> mask) {
  require_equal_sizes(image, truth, covered.size());
  require_equal_sizes(image, truth, mask.size());
  constexpr std::array<double, 5> kWeights{0.0448, 0.2856, 0.3001, 0.2363, 0.1333};
  std::vector<Scale> scales(1);
  scales[0] = {image.width,
               image.height,
               std::vector<double>(covered.begin(), covered.end()),
               std::vector<double>(mask.begin(), mask.end()),
               {},
               {}};
  for (std::size_t c = 0; c < 3; ++c) {
    scales[0].image[c] = channel_of(image, c);
    scales[0].truth[c] = channel_of(truth, c);
  }
  while (scales.size() < kWeights.size() &&
         std::min(scales.back().width, scales.back().height) / 2 > 2 * kRadius) {
    scales.push_back(scales.back().halved());
  }
  double total = 0;
  for (std::size_t i = 0; i < scales.size(); ++i) total += kWeights[i];
  double mean = 0;
  for (std::size_t c = 0; c < 3; ++c) {
    double product = 1;
    for (std::size_t i = 0; i < scales.size(); ++i) {
      const double value = scales[i].mean_similarity(c, i + 1 == scales.size());
      product *= std::pow(std::isnan(value) ? value : std::max(0.0, value), kWeights[i] / total);
    }
    mean += product / 3;
  }
  return mean;
}

}  // namespace raystage::render
