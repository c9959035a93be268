// SPDX-License-Identifier: Apache-2.0
// Converts a decoded frame to the luma image that depths are estimated on: luma in 8-bit codes of
// the sRGB curve, resampled without lens distortion. It is then packed with its three neighbours
// per 32-bit word. Chroma is kept for comparisons of colours. Cost: O(pixels). Reference: Picture
// in camera_depths_reference.cpp.
#include "render/depth/matching_image.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <optional>
#include <vector>

#include "base/parallel.h"
#include "base/transfer_function.h"
#include "store/processing/frames/matching_code.h"

namespace raystage::render {
namespace {

/// Returns how many of the lower bits of a frame's codes do not matter: 12 bits suffice, unless
/// white is a small part of the full scale.
unsigned unused_bits(const store::CodeScale& scale) {
  return scale.space == store::BlendSpace::kHighRange ? 0 : 4;
}

/// Returns 8-bit codes of sRGB's curve for the bits of a frame's codes that matter.
std::vector<float> code_table(const store::CodeScale& scale) {
  const int entries = 1 << (16 - unused_bits(scale));
  std::vector<float> table(static_cast<std::size_t>(entries));
  for (int i = 0; i < entries; ++i) {
    const double code = i / (entries - 1.0);
    if (scale.space == store::BlendSpace::kHighRange) {
      const double light = scale.full_scale * store::part_from_value(scale.space, code);
      table[i] = static_cast<float>(255 * store::matching_code(scale, light));
      continue;
    }
    table[i] = static_cast<float>(
        255 * (scale.space == store::BlendSpace::kLinear ? srgb_from_linear(code) : code));
  }
  return table;
}

/// Luma, and the differences of blue and red from it, halved, around 128: 8-bit codes.
using LumaChroma = std::array<std::uint8_t, 3>;

std::vector<LumaChroma> luma_chroma_of(const store::DecodedFrame& frame,
                                       const store::CodeScale& scale) {
  const std::vector<float> code = code_table(scale);
  const unsigned unused = unused_bits(scale);
  std::vector<LumaChroma> pixels(static_cast<std::size_t>(frame.width) * frame.height);
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    const std::uint16_t* p = frame.rgba.get() + 4 * i;
    const float red = code[p[0] >> unused], green = code[p[1] >> unused],
                blue = code[p[2] >> unused];
    const float y = 0.299F * red + 0.587F * green + 0.114F * blue;
    const auto chroma = [y](float channel) {
      return static_cast<std::uint8_t>(std::clamp((channel - y) / 2 + 128.5F, 0.0F, 255.0F));
    };
    pixels[i] = {static_cast<std::uint8_t>(std::max(1.0F, y + 0.5F)), chroma(blue), chroma(red)};
  }
  return pixels;
}

struct Position {
  double x = 0, y = 0;  ///< pixels
  bool is_shown = false;
};

/// The pixels of a frame that the pixels of a pinhole show. The lens model is computed at every
/// kStep-th pixel of a row and interpolated by cubics between them (to 1e-5 pixels for the lenses
/// of cameras), but where it is not valid nearby.
class FramePositions {
 public:
  FramePositions(const rig::CameraModel& model, const VirtualCamera& pinhole)
      : model_(model),
        k_(pinhole.intrinsics),
        width_(pinhole.width),
        step_(k_.fx >= kMostStep / kMostAngle ? kMostStep : 1) {}

  void find(int y, std::vector<Position>& row) {
    row.resize(static_cast<std::size_t>(width_));
    const int nodes = (width_ - 1) / step_ + 4;  // one before the row, two after it
    nodes_.clear();
    for (int i = 0; i < nodes; ++i) nodes_.push_back(exact((i - 1) * step_, y));
    for (int x = 0; x < width_; ++x) {
      const std::optional<Eigen::Vector2d>* at = nodes_.data() + x / step_;
      if (!at[0] || !at[1] || !at[2] || !at[3]) {
        const auto found = exact(x, y);
        row[x] = found ? position(found->x(), found->y()) : Position{};
        continue;
      }
      const std::array<double, 4>& w = weights_[x % step_];
      const Eigen::Vector2d sum = w[0] * *at[0] + w[1] * *at[1] + w[2] * *at[2] + w[3] * *at[3];
      row[x] = position(sum.x(), sum.y());
    }
  }

 private:
  static constexpr int kMostStep = 8;             // pixels
  static constexpr double kMostAngle = 1.0 / 50;  // radians

  std::optional<Eigen::Vector2d> exact(int x, int y) const {
    return model_.pixel_from_ideal({(x + 0.5 - k_.cx) / k_.fx, (y + 0.5 - k_.cy) / k_.fy});
  }
  Position position(double x, double y) const {
    return {x, y, x >= 0 && y >= 0 && x <= model_.width() && y <= model_.height()};
  }
  /// Returns Lagrange's weights of four nodes, between the middle two.
  static std::array<std::array<double, 4>, kMostStep> cubic_weights() {
    std::array<std::array<double, 4>, kMostStep> weights{};
    for (int i = 0; i < kMostStep; ++i) {
      const double t = static_cast<double>(i) / kMostStep;
      weights[i] = {-t * (t - 1) * (t - 2) / 6, (t + 1) * (t - 1) * (t - 2) / 2,
                    -(t + 1) * t * (t - 2) / 2, (t + 1) * t * (t - 1) / 6};
    }
    return weights;
  }

  const rig::CameraModel& model_;
  const schemas::Intrinsics& k_;
  int width_, step_;
  std::array<std::array<double, 4>, kMostStep> weights_ = cubic_weights();
  std::vector<std::optional<Eigen::Vector2d>> nodes_;
};

/// Returns the frame's values at the pinhole's pixels, 0 where the frame does not show them.
std::vector<LumaChroma> without_distortion(const std::vector<LumaChroma>& pixels,
                                           const rig::CameraModel& model,
                                           const VirtualCamera& pinhole) {
  std::vector<LumaChroma> straight(static_cast<std::size_t>(pinhole.width) * pinhole.height);
  constexpr int kRows = 8;
  raystage::parallel_for(tbb::blocked_range<int>(0, pinhole.height, kRows), [&](const auto& rows) {
    FramePositions positions(model, pinhole);
    std::vector<Position> row;
    const float last_x = static_cast<float>(model.width() - 1),
                last_y = static_cast<float>(model.height() - 1);
    for (int y = rows.begin(); y < rows.end(); ++y) {
      positions.find(y, row);
      LumaChroma* to = &straight[static_cast<std::size_t>(y) * pinhole.width];
      for (const Position& at : row) {
        LumaChroma& result = *to++;
        if (!at.is_shown) continue;
        const float u = std::clamp(static_cast<float>(at.x - 0.5), 0.0F, last_x),
                    v = std::clamp(static_cast<float>(at.y - 0.5), 0.0F, last_y);
        const int left = static_cast<int>(u), top = static_cast<int>(v);
        const LumaChroma* a = &pixels[static_cast<std::size_t>(top) * model.width() + left];
        const std::ptrdiff_t next = left + 1 < model.width() ? 1 : 0;
        const LumaChroma* c = top + 1 < model.height() ? a + model.width() : a;
        const float right = u - static_cast<float>(left), down = v - static_cast<float>(top);
        for (std::size_t i = 0; i < result.size(); ++i) {
          const auto value = [i](const LumaChroma& pixel) { return static_cast<float>(pixel[i]); };
          const float upper = value(a[0]) + right * (value(a[next]) - value(a[0]));
          const float lower = value(c[0]) + right * (value(c[next]) - value(c[0]));
          result[i] = static_cast<std::uint8_t>(upper + down * (lower - upper) + 0.5F);
        }
      }
    }
  });
  return straight;
}

}  // namespace

MatchingImage::MatchingImage(const store::DecodedFrame& frame, const store::CodeScale& scale,
                             const rig::Rig::Camera& camera, const VirtualCamera& pinhole)
    : width_(pinhole.width), height_(pinhole.height) {
  std::vector<LumaChroma> pixels = luma_chroma_of(frame, scale);
  if (camera.model.has_distortion()) pixels = without_distortion(pixels, camera.model, pinhole);
  words_.resize(pixels.size());
  chroma_.resize(pixels.size());
  for (std::size_t i = 0; i < pixels.size(); ++i) chroma_[i] = {pixels[i][1], pixels[i][2]};
  const auto width = static_cast<std::size_t>(width_);
  for (std::size_t y = 0; y < static_cast<std::size_t>(height_); ++y) {
    const std::size_t below = y + 1 < static_cast<std::size_t>(height_) ? width : 0;
    for (std::size_t x = 0; x < width; ++x) {
      const std::size_t at = y * width + x, right = x + 1 < width ? 1 : 0;
      const std::array<std::uint32_t, 4> four{pixels[at][0], pixels[at + right][0],
                                              pixels[at + below][0], pixels[at + below + right][0]};
      if (std::ranges::find(four, 0U) != four.end()) continue;
      words_[at] = four[0] | four[1] << 8U | four[2] << 16U | four[3] << 24U;
    }
  }
}

MatchingImage MatchingImage::cropped(const PixelRectangle& part) const {
  MatchingImage result;
  result.width_ = part.right - part.left;
  result.height_ = part.bottom - part.top;
  for (int y = part.top; y < part.bottom; ++y) {
    const std::ptrdiff_t row = static_cast<std::ptrdiff_t>(y) * width_;
    result.words_.insert(result.words_.end(), words_.begin() + row + part.left,
                         words_.begin() + row + part.right);
    result.chroma_.insert(result.chroma_.end(), chroma_.begin() + row + part.left,
                          chroma_.begin() + row + part.right);
  }
  return result;
}

std::vector<std::uint8_t> MatchingImage::plane() const {
  std::vector<std::uint8_t> luma(words_.size());
  std::ranges::transform(words_, luma.begin(),
                         [](std::uint32_t word) { return static_cast<std::uint8_t>(word); });
  return luma;
}

}  // namespace raystage::render
