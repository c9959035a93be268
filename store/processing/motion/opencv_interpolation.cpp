// SPDX-License-Identifier: Apache-2.0
// Interpolates a frame at a time between two frames by optical flow in both directions (Baker et
// al., IJCV 2011, section 3.3.2). Forward-projects both flow fields to that time and keeps the
// vector with the smallest photometric difference per pixel. Fills holes from their borders and
// applies a median filter. Then samples both frames bicubically and weights them by time and
// visibility. Inputs: two frames of equal size, flow in pixels. Cost: O(pixels).
// With a rolling shutter the fraction of the time depends on the row. A point that is at height y
// of a, and moves by v rows to b, is exposed in a at the time part_a(y) = part - line_part (y - c)
// before the instant, and the two exposures are 1 + line_part v apart: it has moved by the fraction
// s = part_a(y) / (1 + line_part v) at the instant. At height y' = y + s v of the interpolated
// frame this is s = part - line_part (y' - c), whatever v is.
#include "store/processing/motion/opencv_interpolation.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "store/processing/motion/opencv_flow.h"

namespace raystage::store {
namespace {

constexpr float kUnset = std::numeric_limits<float>::max();
// Flow vectors that differ by less belong to one surface: pixels, and pixels per pixel of motion.
constexpr float kSameShift = 1, kSamePerShift = 0.05F;
// The largest component of a valid flow vector, pixels.
constexpr float kMaxMotion = 65536;
// Side of the window, in pixels, over which differences are averaged: single pixels match by
// chance.
constexpr int kWindow = 5;
// Visibility of occluded frames: matters only where both frames are occluded.
constexpr float kHidden = 1e-3F;
// The least time between the exposures of a point in two frames that is plausible, in fractions of
// the time between these: one that moves with the rows, as fast as these are read.
constexpr float kMinApart = 0.1F;

// Returns the fraction within the range that is extrapolated.
float limited(float part) {
  constexpr auto kMost = static_cast<float>(kMaxExtrapolation);
  return std::clamp(part, -kMost, 1 + kMost);
}

// The flow at the intermediate time, as displacements from a to b.
class MotionBetween {
 public:
  MotionBetween(int width, int height)
      : shift_(width, height), difference_(width, height, kUnset) {}

  // Projects every pixel of `from` by a fraction of its flow. `parts`: the time of each row from
  // `from` to the instant; `line`: the line time, negative if
  // `from` is b. `sign`: -1 if `from` is b.
  void project(const Luma& from, const Luma& to, const FlowField& motion,
               std::span<const float> parts, float line, float sign) {
    const cv::Mat difference = differences(from, to, motion);
    for (int y = 0; y < shift_.height; ++y) {
      const float of_row = parts[static_cast<std::size_t>(y)];
      for (int x = 0; x < shift_.width; ++x) {
        const FlowVector s = motion.at(x, y);
        if (!is_valid(s)) continue;
        float part = of_row;
        if (line != 0) {
          const float apart = 1 + line * s.y;
          if (!(apart > kMinApart)) continue;
          part = limited(of_row / apart);
        }
        land(static_cast<float>(x) + part * s.x, static_cast<float>(y) + part * s.y,
             {sign * s.x, sign * s.y}, difference.at<float>(y, x));
      }
    }
  }

  // Fills pixels without a vector, from their borders inwards.
  void fill_holes() {
    std::vector<std::size_t> ring;
    for (std::size_t i = 0; i < difference_.values.size(); ++i) {
      if (difference_.values[i] == kUnset && has_known_neighbour(i)) ring.push_back(i);
    }
    while (!ring.empty()) {
      std::vector<FlowVector> values;
      values.reserve(ring.size());
      for (const std::size_t i : ring) values.push_back(mean_of_neighbours(i));
      for (std::size_t k = 0; k < ring.size(); ++k) {
        shift_.values[ring[k]] = values[k];
        difference_.values[ring[k]] = 0;
      }
      std::vector<std::size_t> next;
      for (const std::size_t i : ring) {
        for_neighbours(i, [&](std::size_t n) {
          if (difference_.values[n] == kUnset) {
            difference_.values[n] = -1;  // already in `next`
            next.push_back(n);
          }
        });
      }
      for (const std::size_t n : next) difference_.values[n] = kUnset;
      ring = std::move(next);
    }
  }

  void filter_medians() { median_filter_flow(shift_); }

  const FlowField& shift() const { return shift_; }

 private:
  // Returns whether a vector is plausible: flow may diverge where the frames have nothing in
  // common.
  static bool is_valid(FlowVector s) {
    return std::abs(s.x) < kMaxMotion && std::abs(s.y) < kMaxMotion;
  }

  // Returns the mean absolute difference of luma along the flow around each pixel, codes
  // (CV_32FC1).
  cv::Mat differences(const Luma& from, const Luma& to, const FlowField& motion) const {
    cv::Mat difference(shift_.height, shift_.width, CV_32FC1), mean;
    for (int y = 0; y < shift_.height; ++y) {
      for (int x = 0; x < shift_.width; ++x) {
        const FlowVector s = is_valid(motion.at(x, y)) ? motion.at(x, y) : FlowVector{};
        difference.at<float>(y, x) =
            std::abs(static_cast<float>(from.at(x, y)) -
                     luma_at(to, static_cast<float>(x) + s.x, static_cast<float>(y) + s.y));
      }
    }
    cv::blur(difference, mean, {kWindow, kWindow});
    return mean;
  }

  static float luma_at(const Luma& luma, float x, float y) {
    const int width = luma.width, height = luma.height;
    x = std::clamp(x, 0.0F, static_cast<float>(width - 1));
    y = std::clamp(y, 0.0F, static_cast<float>(height - 1));
    const int x0 = std::min(static_cast<int>(x), std::max(0, width - 2));
    const int y0 = std::min(static_cast<int>(y), std::max(0, height - 2));
    const int x1 = std::min(x0 + 1, width - 1), y1 = std::min(y0 + 1, height - 1);
    const float u = x - static_cast<float>(x0), v = y - static_cast<float>(y0);
    const auto at = [&](int column, int row) { return static_cast<float>(luma.at(column, row)); };
    return (1 - v) * ((1 - u) * at(x0, y0) + u * at(x1, y0)) +
           v * ((1 - u) * at(x0, y1) + u * at(x1, y1));
  }

  void land(float x, float y, FlowVector shift, float difference) {
    const int column = static_cast<int>(std::floor(x + 0.5F));
    const int row = static_cast<int>(std::floor(y + 0.5F));
    if (!shift_.contains(column, row) || difference >= difference_.at(column, row)) return;
    difference_.at(column, row) = difference;
    shift_.at(column, row) = shift;
  }

  template <class Visit>
  void for_neighbours(std::size_t i, const Visit& visit) const {
    const int x = static_cast<int>(i) % shift_.width, y = static_cast<int>(i) / shift_.width;
    for (int row = std::max(0, y - 1); row <= std::min(shift_.height - 1, y + 1); ++row) {
      for (int column = std::max(0, x - 1); column <= std::min(shift_.width - 1, x + 1); ++column) {
        const std::size_t n = shift_.offset(column, row);
        if (n != i) visit(n);
      }
    }
  }
  bool has_known_neighbour(std::size_t i) const {
    bool known = false;
    for_neighbours(i, [&](std::size_t n) { known = known || difference_.values[n] != kUnset; });
    return known;
  }
  FlowVector mean_of_neighbours(std::size_t i) const {
    FlowVector sum;
    float count = 0;
    for_neighbours(i, [&](std::size_t n) {
      if (difference_.values[n] == kUnset) return;
      sum.x += shift_.values[n].x;
      sum.y += shift_.values[n].y;
      ++count;
    });
    return {sum.x / count, sum.y / count};
  }

  FlowField shift_;
  Image<float> difference_;  // kUnset: no vector yet
};

// Where and how one of the two frames is sampled for the intermediate time.
struct WarpedFrame {
  cv::Mat motion;  // CV_32FC2: the frame's own flow at the sampled positions
  cv::Mat x, y;    // sampled positions, pixels
};

// Returns where a frame is sampled along the vectors of `between`. `ways`: factors from these to
// the displacement to the frame, by row.
WarpedFrame warp(const FlowField& motion, const FlowField& between, std::span<const float> ways) {
  const int width = motion.width, height = motion.height;
  WarpedFrame out;
  out.x.create(height, width, CV_32FC1);
  out.y.create(height, width, CV_32FC1);
  for (int y = 0; y < height; ++y) {
    auto* to_x = out.x.ptr<float>(y);
    auto* to_y = out.y.ptr<float>(y);
    const float way = ways[static_cast<std::size_t>(y)];
    for (int x = 0; x < width; ++x) {
      to_x[x] = static_cast<float>(x) + way * between.at(x, y).x;
      to_y[x] = static_cast<float>(y) + way * between.at(x, y).y;
    }
  }
  // cv::Mat has no const data; this matrix is only read.
  const cv::Mat own(height, width, CV_32FC2, const_cast<FlowVector*>(motion.values.data()));
  cv::remap(own, out.motion, out.x, out.y, cv::INTER_LINEAR, cv::BORDER_REPLICATE);
  return out;
}

// Samples a picture bicubically. `type`: of its pixels, for OpenCV.
template <class Code>
cv::Mat sampled(std::span<const Code> picture, int type, const WarpedFrame& at) {
  const cv::Mat from(at.x.rows, at.x.cols, type, const_cast<Code*>(picture.data()));
  cv::Mat out;
  cv::remap(from, out, at.x, at.y, cv::INTER_CUBIC, cv::BORDER_REPLICATE);
  return out;
}

// Returns 1 if the frame's own flow at (x, y) agrees with `shift`, towards 0 if it differs.
float visibility(float x, float y, int width, int height, const cv::Vec2f& own, float sign,
                 FlowVector shift) {
  if (x < -0.5F || y < -0.5F || x > static_cast<float>(width) - 0.5F ||
      y > static_cast<float>(height) - 0.5F) {
    return 0;
  }
  const float dx = sign * own[0] - shift.x, dy = sign * own[1] - shift.y;
  const float same = kSameShift + kSamePerShift * std::sqrt(shift.x * shift.x + shift.y * shift.y);
  const float ratio = (dx * dx + dy * dy) / (same * same);
  return 1 / (1 + ratio * ratio);
}

// Writes the picture between `a` and `b`, of kChannels codes a pixel.
template <int kChannels, class Code>
void interpolate(const MovingPair& pair, const InstantBetween& instant, int type,
                 std::span<const Code> a, std::span<const Code> b, std::span<Code> out) {
  const int width = pair.a.width, height = pair.a.height;
  std::vector<float> after_a, before_b, parts, to_a, to_b;  // by row
  for (int y = 0; y < height; ++y) {
    after_a.push_back(static_cast<float>(instant.at(y + 0.5, height)));
    before_b.push_back(1 - after_a.back());
    parts.push_back(limited(after_a.back()));
    to_a.push_back(-parts.back());
    to_b.push_back(1 - parts.back());
  }
  const auto line = static_cast<float>(instant.line_part);
  MotionBetween between(width, height);
  between.project(pair.a, pair.b, pair.b_from_a, after_a, line, 1);
  between.project(pair.b, pair.a, pair.a_from_b, before_b, -line, -1);
  between.fill_holes();
  between.filter_medians();
  const FlowField& shift = between.shift();
  const WarpedFrame in_a = warp(pair.b_from_a, shift, to_a);
  const WarpedFrame in_b = warp(pair.a_from_b, shift, to_b);
  const cv::Mat of_a = sampled(a, type, in_a), of_b = sampled(b, type, in_b);
  using Pixel = cv::Vec<Code, kChannels>;
  std::size_t i = 0;
  for (int y = 0; y < height; ++y) {
    // An extrapolated row has the colours of the nearer frame alone.
    const float s = std::clamp(parts[static_cast<std::size_t>(y)], 0.0F, 1.0F);
    const auto *xa = in_a.x.ptr<float>(y), *ya = in_a.y.ptr<float>(y);
    const auto *xb = in_b.x.ptr<float>(y), *yb = in_b.y.ptr<float>(y);
    const auto *own_a = in_a.motion.ptr<cv::Vec2f>(y), *own_b = in_b.motion.ptr<cv::Vec2f>(y);
    const auto *pixels_a = of_a.ptr<Pixel>(y), *pixels_b = of_b.ptr<Pixel>(y);
    for (int x = 0; x < width; ++x, ++i) {
      const float seen_a = visibility(xa[x], ya[x], width, height, own_a[x], 1, shift.at(x, y));
      const float seen_b = visibility(xb[x], yb[x], width, height, own_b[x], -1, shift.at(x, y));
      const float weight_a = (1 - s) * (seen_a + kHidden), weight_b = s * (seen_b + kHidden);
      const float scale = 1 / (weight_a + weight_b);
      for (int c = 0; c < kChannels; ++c) {
        const float value = scale * (weight_a * static_cast<float>(pixels_a[x][c]) +
                                     weight_b * static_cast<float>(pixels_b[x][c]));
        out[kChannels * i + static_cast<std::size_t>(c)] = static_cast<Code>(value + 0.5F);
      }
    }
  }
}

}  // namespace

void interpolate_codes(const MovingPair& pair, const InstantBetween& instant,
                       std::span<const std::uint8_t> a, std::span<const std::uint8_t> b,
                       std::span<std::uint8_t> out) {
  interpolate<3, std::uint8_t>(pair, instant, CV_8UC3, a, b, out);
}

void interpolate_rgba_levels(const MovingPair& pair, const InstantBetween& instant,
                             std::span<const std::uint16_t> a, std::span<const std::uint16_t> b,
                             std::span<std::uint16_t> out) {
  interpolate<4, std::uint16_t>(pair, instant, CV_16UC4, a, b, out);
}

}  // namespace raystage::store
