// SPDX-License-Identifier: Apache-2.0
#include "store/processing/retime/in_between.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

namespace raystage {
namespace {

constexpr float kUnset = std::numeric_limits<float>::max();
// Motions that differ by less are of one surface: pixels, and per pixel of motion.
constexpr float kSameShift = 1, kSamePerShift = 0.05F;
// No motion goes further, pixels.
constexpr float kFarthest = 65536;
// How alike pictures look is the mean over a window of as many pixels a side: one pixel alone is
// alike by chance, and motion decided by chance is speckled.
constexpr int kWindow = 5;
// What remains of a picture where it seems hidden: decides only where both do.
constexpr float kHidden = 1e-3F;

// Motion at the moment in between, in whole shifts from a to b.
class MotionBetween {
 public:
  MotionBetween(int width, int height)
      : width_(width),
        height_(height),
        shift_(static_cast<std::size_t>(width) * static_cast<std::size_t>(height)),
        difference_(shift_.size(), kUnset) {}

  // Every pixel of `from` goes `part` of its way; `sign` makes its shift one from a to b.
  void bring(const Picture& from, const Picture& to, const MotionField& motion, float part,
             float sign) {
    const cv::Mat difference = differences(from, to, motion);
    std::size_t i = 0;
    for (int y = 0; y < height_; ++y) {
      for (int x = 0; x < width_; ++x, ++i) {
        const Shift s = motion.shift[i];
        if (!goes_somewhere(s)) continue;
        land(static_cast<float>(x) + part * s.x, static_cast<float>(y) + part * s.y,
             {sign * s.x, sign * s.y}, difference.at<float>(y, x));
      }
    }
  }

  // Places that nothing came to, from their borders inwards.
  void fill_holes() {
    std::vector<std::size_t> ring;
    for (std::size_t i = 0; i < shift_.size(); ++i) {
      if (difference_[i] == kUnset && has_known_neighbour(i)) ring.push_back(i);
    }
    while (!ring.empty()) {
      std::vector<Shift> values;
      values.reserve(ring.size());
      for (const std::size_t i : ring) values.push_back(mean_of_neighbours(i));
      for (std::size_t k = 0; k < ring.size(); ++k) {
        shift_[ring[k]] = values[k];
        difference_[ring[k]] = 0;
      }
      std::vector<std::size_t> next;
      for (const std::size_t i : ring) {
        for_neighbours(i, [&](std::size_t n) {
          if (difference_[n] == kUnset) {
            difference_[n] = -1;  // listed once
            next.push_back(n);
          }
        });
      }
      for (const std::size_t n : next) difference_[n] = kUnset;
      ring = std::move(next);
    }
  }

  void take_medians() { take_median_shifts(shift_, width_, height_); }

  const std::vector<Shift>& shift() const { return shift_; }

 private:
  // Flow may run away where pictures have nothing in common.
  static bool goes_somewhere(Shift s) {
    return std::abs(s.x) < kFarthest && std::abs(s.y) < kFarthest;
  }

  // CV_32FC1: how unlike the pictures look along the motion around each pixel, codes.
  cv::Mat differences(const Picture& from, const Picture& to, const MotionField& motion) const {
    cv::Mat difference(height_, width_, CV_32FC1), mean;
    std::size_t i = 0;
    for (int y = 0; y < height_; ++y) {
      for (int x = 0; x < width_; ++x, ++i) {
        const Shift s = goes_somewhere(motion.shift[i]) ? motion.shift[i] : Shift{};
        difference.at<float>(y, x) =
            std::abs(static_cast<float>(from.luma[i]) -
                     luma_at(to, static_cast<float>(x) + s.x, static_cast<float>(y) + s.y));
      }
    }
    cv::blur(difference, mean, {kWindow, kWindow});
    return mean;
  }

  static float luma_at(const Picture& picture, float x, float y) {
    const int width = picture.rgb.width, height = picture.rgb.height;
    x = std::clamp(x, 0.0F, static_cast<float>(width - 1));
    y = std::clamp(y, 0.0F, static_cast<float>(height - 1));
    const int x0 = std::min(static_cast<int>(x), std::max(0, width - 2));
    const int y0 = std::min(static_cast<int>(y), std::max(0, height - 2));
    const int x1 = std::min(x0 + 1, width - 1), y1 = std::min(y0 + 1, height - 1);
    const float u = x - static_cast<float>(x0), v = y - static_cast<float>(y0);
    const auto at = [&](int column, int row) {
      return static_cast<float>(
          picture.luma[static_cast<std::size_t>(row) * static_cast<std::size_t>(width) +
                       static_cast<std::size_t>(column)]);
    };
    return (1 - v) * ((1 - u) * at(x0, y0) + u * at(x1, y0)) +
           v * ((1 - u) * at(x0, y1) + u * at(x1, y1));
  }

  void land(float x, float y, Shift shift, float difference) {
    const int column = static_cast<int>(std::floor(x + 0.5F));
    const int row = static_cast<int>(std::floor(y + 0.5F));
    if (column < 0 || row < 0 || column >= width_ || row >= height_) return;
    const std::size_t i = index(column, row);
    if (difference >= difference_[i]) return;
    difference_[i] = difference;
    shift_[i] = shift;
  }

  std::size_t index(int column, int row) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(width_) +
           static_cast<std::size_t>(column);
  }
  template <class Visit>
  void for_neighbours(std::size_t i, const Visit& visit) const {
    const int x = static_cast<int>(i % static_cast<std::size_t>(width_));
    const int y = static_cast<int>(i / static_cast<std::size_t>(width_));
    for (int row = std::max(0, y - 1); row <= std::min(height_ - 1, y + 1); ++row) {
      for (int column = std::max(0, x - 1); column <= std::min(width_ - 1, x + 1); ++column) {
        const std::size_t n = index(column, row);
        if (n != i) visit(n);
      }
    }
  }
  bool has_known_neighbour(std::size_t i) const {
    bool known = false;
    for_neighbours(i, [&](std::size_t n) { known = known || difference_[n] != kUnset; });
    return known;
  }
  Shift mean_of_neighbours(std::size_t i) const {
    Shift sum;
    float count = 0;
    for_neighbours(i, [&](std::size_t n) {
      if (difference_[n] == kUnset) return;
      sum.x += shift_[n].x;
      sum.y += shift_[n].y;
      ++count;
    });
    return {sum.x / count, sum.y / count};
  }

  int width_, height_;
  std::vector<Shift> shift_;
  std::vector<float> difference_;  // kUnset: nothing came
};

// One of the two pictures as seen from the moment in between.
struct Sought {
  cv::Mat rgb;     // CV_8UC3
  cv::Mat motion;  // CV_32FC2: the picture's own motion there
  cv::Mat x, y;    // where it was sought
};

// `way`: from the moment in between to the picture, in whole shifts.
Sought seek(const Picture& picture, const MotionField& motion, const std::vector<Shift>& between,
            float way) {
  const int width = picture.rgb.width, height = picture.rgb.height;
  Sought out;
  out.x.create(height, width, CV_32FC1);
  out.y.create(height, width, CV_32FC1);
  for (int y = 0; y < height; ++y) {
    auto* to_x = out.x.ptr<float>(y);
    auto* to_y = out.y.ptr<float>(y);
    const Shift* shift = &between[static_cast<std::size_t>(y) * static_cast<std::size_t>(width)];
    for (int x = 0; x < width; ++x) {
      to_x[x] = static_cast<float>(x) + way * shift[x].x;
      to_y[x] = static_cast<float>(y) + way * shift[x].y;
    }
  }
  // OpenCV's matrices do not know const; these are only read.
  const cv::Mat rgb(height, width, CV_8UC3, const_cast<std::uint8_t*>(picture.rgb.pixels.data()));
  const cv::Mat own(height, width, CV_32FC2, const_cast<Shift*>(motion.shift.data()));
  cv::remap(rgb, out.rgb, out.x, out.y, cv::INTER_CUBIC, cv::BORDER_REPLICATE);
  cv::remap(own, out.motion, out.x, out.y, cv::INTER_LINEAR, cv::BORDER_REPLICATE);
  return out;
}

// 1 where the picture shows at (x, y) what moves by `shift`, towards 0 where it shows another
// thing.
float visibility(float x, float y, int width, int height, const cv::Vec2f& own, float sign,
                 Shift shift) {
  if (x < -0.5F || y < -0.5F || x > static_cast<float>(width) - 0.5F ||
      y > static_cast<float>(height) - 0.5F) {
    return 0;
  }
  const float dx = sign * own[0] - shift.x, dy = sign * own[1] - shift.y;
  const float same = kSameShift + kSamePerShift * std::sqrt(shift.x * shift.x + shift.y * shift.y);
  const float ratio = (dx * dx + dy * dy) / (same * same);
  return 1 / (1 + ratio * ratio);
}

}  // namespace

RgbImage blend(const RgbImage& a, const RgbImage& b, double part) {
  RgbImage out{a.width, a.height, {}};
  out.pixels.resize(a.pixels.size());
  const auto weight = static_cast<float>(part);
  for (std::size_t i = 0; i < out.pixels.size(); ++i) {
    const float value =
        (1 - weight) * static_cast<float>(a.pixels[i]) + weight * static_cast<float>(b.pixels[i]);
    out.pixels[i] = static_cast<std::uint8_t>(value + 0.5F);
  }
  return out;
}

RgbImage in_between(const Picture& a, const Picture& b, const MotionField& b_from_a,
                    const MotionField& a_from_b, double part) {
  const int width = a.rgb.width, height = a.rgb.height;
  const auto s = static_cast<float>(part);
  MotionBetween between(width, height);
  between.bring(a, b, b_from_a, s, 1);
  between.bring(b, a, a_from_b, 1 - s, -1);
  between.fill_holes();
  between.take_medians();
  const std::vector<Shift>& shift = between.shift();
  const Sought in_a = seek(a, b_from_a, shift, -s);
  const Sought in_b = seek(b, a_from_b, shift, 1 - s);

  RgbImage out{width, height, std::vector<std::uint8_t>(a.rgb.pixels.size())};
  std::size_t i = 0;
  for (int y = 0; y < height; ++y) {
    const auto *xa = in_a.x.ptr<float>(y), *ya = in_a.y.ptr<float>(y);
    const auto *xb = in_b.x.ptr<float>(y), *yb = in_b.y.ptr<float>(y);
    const auto *own_a = in_a.motion.ptr<cv::Vec2f>(y), *own_b = in_b.motion.ptr<cv::Vec2f>(y);
    const auto *rgb_a = in_a.rgb.ptr<cv::Vec3b>(y), *rgb_b = in_b.rgb.ptr<cv::Vec3b>(y);
    for (int x = 0; x < width; ++x, ++i) {
      const float seen_a = visibility(xa[x], ya[x], width, height, own_a[x], 1, shift[i]);
      const float seen_b = visibility(xb[x], yb[x], width, height, own_b[x], -1, shift[i]);
      const float weight_a = (1 - s) * (seen_a + kHidden), weight_b = s * (seen_b + kHidden);
      const float scale = 1 / (weight_a + weight_b);
      for (int c = 0; c < 3; ++c) {
        const float value = scale * (weight_a * static_cast<float>(rgb_a[x][c]) +
                                     weight_b * static_cast<float>(rgb_b[x][c]));
        out.pixels[3 * i + static_cast<std::size_t>(c)] = static_cast<std::uint8_t>(value + 0.5F);
      }
    }
  }
  return out;
}

}  // namespace raystage
