// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <cstdint>

#include "rig/row_times.h"
#include "store/jpeg/rgb_image.h"

namespace raystage::testing {

/// For tests: a patterned board that moves to the right over a patterned wall, exact at any time.
struct MovingBoard {
  int width = 160, height = 120;
  double size = 44;                    ///< of the board, pixels
  double left = 40, top = 36;          ///< its position at time 0
  double speed_x = 12, speed_y = 4.5;  ///< pixels per unit of time

  bool covers(double x, double y, double time) const {
    const double u = x - left - speed_x * time, v = y - top - speed_y * time;
    return u >= 0 && v >= 0 && u < size && v < size;
  }
  /// Returns the picture at `time` with 2 x 2 samples per pixel; pixel (0, 0) is centred on (0, 0).
  store::RgbImage at(double time) const { return rolling_at(time, 0); }

  /// Returns the picture of a rolling shutter: the middle row is exposed at `time`, each row by
  /// `line` after the row above.
  store::RgbImage rolling_at(double time, double line) const {
    store::RgbImage image{width, height, std::vector<std::uint8_t>()};
    for (int y = 0; y < height; ++y) {
      const double of_row = time + rig::row_time(line, height, y + 0.5);
      for (int x = 0; x < width; ++x) {
        for (int c = 0; c < 3; ++c) {
          double sum = 0;
          for (int s = 0; s < 4; ++s) {
            const int right = s % 2, down = s / 2;
            sum += value(x + (right - 0.5) / 2, y + (down - 0.5) / 2, of_row, c);
          }
          image.values.push_back(static_cast<std::uint8_t>(std::lround(sum / 4)));
        }
      }
    }
    return image;
  }

 private:
  double value(double x, double y, double time, int c) const {
    if (covers(x, y, time)) {
      const double u = x - left - speed_x * time, v = y - top - speed_y * time;
      return 190 + 30 * std::sin(0.9 * u + c) * std::sin(0.7 * v) + 25 * std::sin(0.31 * (u + v));
    }
    return 80 + 30 * std::sin(0.6 * x - c) * std::cos(0.8 * y) + 25 * std::sin(0.23 * (x - 2 * y));
  }
};

/// Returns the PSNR in dB over the pixels for which `counts(x, y)` is true.
template <class Counts>
double psnr(const store::RgbImage& image, const store::RgbImage& truth, const Counts& counts) {
  double sum = 0, number = 0;
  for (int y = 0; y < truth.height; ++y) {
    for (int x = 0; x < truth.width; ++x) {
      if (!counts(x, y)) continue;
      for (int c = 0; c < 3; ++c) {
        const auto i = static_cast<std::size_t>(3 * (y * truth.width + x) + c);
        const double difference = image.values[i] - truth.values[i];
        sum += difference * difference;
        ++number;
      }
    }
  }
  return 10 * std::log10(255.0 * 255.0 * number / sum);
}
inline double psnr(const store::RgbImage& image, const store::RgbImage& truth) {
  return psnr(image, truth, [](int, int) { return true; });
}

}  // namespace raystage::testing
