// SPDX-License-Identifier: Apache-2.0
// Photometric correction of decoded frames (thesis eq. 4.1 and section 4.3). A response with only
// curve, contrast and brightness is one table of 256 codes per channel. Otherwise a pass over the
// wanted MCUs subtracts hot pixels, multiplies by vignetting and gain map, applies the colour
// matrix and converts by a table of 65536 levels. Hot pixels above a limit become the mean of
// neighbours. Input and output: R, G, B, A, 16 bits, in place. Must match
// PhotometricCorrection::reference(). Cost: constant per wanted pixel, in chunks of 128 that stay
// in the L1 cache.
#include "store/processing/frames/photometric_correction.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "base/transfer_function.h"
#include "store/linear_from_frame_code.h"
#include "store/pixel_light.h"

namespace raystage::store {
namespace {

constexpr int kCodes = 256;
constexpr std::size_t kLevels = 65536;

double linear_from_code(const schemas::PhotometricResponse& response,
                        const schemas::TakeDocument& take, std::size_t c, int code) {
  const double corrected =
      rig::evaluate_response_curve(response.curve[c], code / double{kCodes - 1});
  return linear_from_frame_code(take, corrected * (kCodes - 1));
}

std::uint16_t level_of(double light, const CodeScale& scale) {
  const double part = std::clamp(light / scale.full_scale, 0.0, 1.0);
  return static_cast<std::uint16_t>(value_from_part(scale.space, part) * (kLevels - 1) + 0.5);
}

/// Returns the brightest light of a camera whose white has the light `white` per channel.
double max_corrected_light(const schemas::PhotometricResponse& response, rig::PictureSize size,
                           const schemas::Rgb& white) {
  schemas::Rgb brightest{}, most_gain{1, 1, 1};
  if (response.gain_map) {
    for (const schemas::Rgb& node : response.gain_map->gain) {
      for (std::size_t c = 0; c < 3; ++c) most_gain[c] = std::max(most_gain[c], node[c]);
    }
  }
  if (response.vignetting) {
    schemas::PhotometricResponse lens;
    lens.vignetting = response.vignetting;
    double most = 0;
    constexpr int kSteps = 16;  // enough for a smooth polynomial
    for (int j = 0; j <= kSteps; ++j) {
      for (int i = 0; i <= kSteps; ++i) {
        const double x = 1.0 * i * size.width / kSteps, y = 1.0 * j * size.height / kSteps;
        most = std::max(most, rig::gain_at(lens, size, x, y)[0]);
      }
    }
    for (double& gain : most_gain) gain *= most;
  }
  for (std::size_t c = 0; c < 3; ++c) {
    brightest[c] = most_gain[c] * (response.brightness[c] + response.contrast[c] * white[c]);
  }
  double most = 0;
  for (const schemas::Rgb& row : response.matrix) {
    double sum = 0;
    for (std::size_t c = 0; c < 3; ++c) sum += std::max(0.0, row[c]) * std::max(0.0, brightest[c]);
    most = std::max(most, sum);
  }
  return most;
}

/// Returns the light of a sample's light by one channel of a response's curve.
double light_by_curve(const std::vector<double>& curve, double light) {
  if (curve.empty() || light <= 0) return light;
  const auto corrected = [&](double of) {
    return linear_from_srgb(rig::evaluate_response_curve(curve, srgb_from_linear(of)));
  };
  return light <= 1 ? corrected(light) : light * corrected(1);
}

/// Returns a response that also converts a camera's primaries to Rec.709.
schemas::PhotometricResponse with_primaries(schemas::PhotometricResponse response,
                                            const schemas::PixelEncoding& encoding) {
  if (!encoding.chromaticities) return response;
  const schemas::ColorMatrix to = rec709_from(encoding), own = response.matrix;
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) {
      response.matrix[i][j] = to[i][0] * own[0][j] + to[i][1] * own[1][j] + to[i][2] * own[2][j];
    }
  }
  return response;
}

bool exceeds_limit(const schemas::HotPixel& pixel) {
  return std::ranges::max(pixel.light) > schemas::PhotometricResponse::kMaxHotPixelLevel;
}

}  // namespace

double max_linear_light(const schemas::PhotometricResponse& response, rig::PictureSize size,
                        const schemas::TakeDocument& take) {
  schemas::Rgb white{};
  for (std::size_t c = 0; c < 3; ++c) white[c] = linear_from_code(response, take, c, kCodes - 1);
  return max_corrected_light(response, size, white);
}

double max_linear_light(const schemas::PhotometricResponse& response, rig::PictureSize size,
                        const schemas::PixelEncoding& encoding) {
  schemas::Rgb white{};
  for (std::size_t c = 0; c < 3; ++c) white[c] = light_by_curve(response.curve[c], encoding.peak);
  return max_corrected_light(with_primaries(response, encoding), size, white);
}

/// The gains of a frame, row by row.
class PhotometricCorrection::Gains {
 public:
  Gains(const schemas::PhotometricResponse& response, rig::PictureSize size)
      : size_(size), map_(response.gain_map), vignetting_(response.vignetting) {}

  /// Computes the gains of row y, channel after channel.
  void of_row(int y, std::vector<float>& gains) const {
    const auto width = static_cast<std::size_t>(size_.width);
    if (map_) {
      gains.resize(3 * width);
      interpolate_map(y, gains);
    } else {
      gains.assign(3 * width, 1.0F);
    }
    if (vignetting_) {
      for (std::size_t c = 0; c < 3; ++c) multiply_vignetting(y, &gains[c * width]);
    }
  }

 private:
  void interpolate_map(int y, std::vector<float>& gains) const {
    const double down = (y + 0.5) / size_.height * (map_->rows - 1);
    const int row = std::min(static_cast<int>(down), map_->rows - 2);
    const auto share = static_cast<float>(down - row);
    const schemas::Rgb* const above =
        &map_->gain[static_cast<std::size_t>(row) * static_cast<std::size_t>(map_->columns)];
    const schemas::Rgb* const below = above + map_->columns;
    const float step = static_cast<float>(map_->columns - 1) / static_cast<float>(size_.width);
    for (int c = 0; c < 3; ++c) {
      for (int x = 0; x < size_.width; ++x) {
        const float along = (static_cast<float>(x) + 0.5F) * step;
        const int column = std::min(static_cast<int>(along), map_->columns - 2);
        const float part = along - static_cast<float>(column);
        const auto node = [&](const schemas::Rgb* row_of, int i) {
          return static_cast<float>(row_of[i][c]);
        };
        const float left = std::lerp(node(above, column), node(below, column), share);
        const float right = std::lerp(node(above, column + 1), node(below, column + 1), share);
        gains[c * size_.width + x] = left + part * (right - left);
      }
    }
  }

  void multiply_vignetting(int y, float* gains) const {
    const double half_diagonal = std::hypot(size_.width, size_.height) / 2;
    const auto down = static_cast<float>((y + 0.5 - vignetting_->cy) / half_diagonal);
    const auto start = static_cast<float>((0.5 - vignetting_->cx) / half_diagonal);
    const auto step = static_cast<float>(1 / half_diagonal);
    const auto a0 = static_cast<float>(vignetting_->a[0]);
    const auto a1 = static_cast<float>(vignetting_->a[1]);
    const auto a2 = static_cast<float>(vignetting_->a[2]);
    for (int x = 0; x < size_.width; ++x) {
      const float across = start + static_cast<float>(x) * step;
      const float r2 = across * across + down * down;
      gains[x] *= 1 + r2 * (a0 + r2 * (a1 + r2 * a2));
    }
  }

  rig::PictureSize size_;
  std::optional<schemas::GainMap> map_;
  std::optional<schemas::Vignetting> vignetting_;
};

/// The correction of single pixels.
class PhotometricCorrection::Pixels {
 public:
  /// `shown(channel, code)`: the light of a code, of `codes` ones, before contrast and brightness.
  template <class Shown>
  Pixels(const schemas::PhotometricResponse& response, rig::PictureSize size, int codes,
         const Shown& shown, const CodeScale& scale, LevelTable levels)
      : dark_(response.hot_pixels), levels_(std::move(levels)) {
    for (std::size_t c = 0; c < 3; ++c) {
      contrast_[c] = static_cast<float>(response.contrast[c]);
      light_[c].resize(static_cast<std::size_t>(codes));
      for (int code = 0; code < codes; ++code) {
        light_[c][code] =
            static_cast<float>(response.brightness[c] + response.contrast[c] * shown(c, code));
      }
      for (std::size_t k = 0; k < 3; ++k) {
        matrix_[c][k] = static_cast<float>(response.matrix[c][k] / scale.full_scale);
      }
    }
    if (response.vignetting || response.gain_map) gains_.emplace(response, size);
  }

  void correct(std::span<std::uint16_t> rgba, const JpegLayout& layout,
               const McuMask& wanted) const {
    auto dark = dark_.begin();
    std::vector<float> gains;
    for (int row = 0; row < layout.mcu_rows; ++row) {
      const std::uint8_t* const wanted_row =
          wanted.data() + static_cast<std::ptrdiff_t>(row) * layout.mcus_per_row;
      const int top = row * layout.mcu_height;
      const int bottom = std::min(top + layout.mcu_height, layout.height);
      const auto first_dark = dark;
      dark = std::find_if(dark, dark_.end(),
                          [&](const schemas::HotPixel& p) { return p.y >= bottom; });
      if (std::all_of(wanted_row, wanted_row + layout.mcus_per_row,
                      [](auto is) { return is == 0; }))
        continue;
      auto of_row = first_dark;
      for (int y = top; y < bottom; ++y) {
        if (gains_) gains_->of_row(y, gains);
        const auto begin = of_row;
        of_row = std::find_if(of_row, dark, [&](const schemas::HotPixel& p) { return p.y > y; });
        correct_row(&rgba[4 * static_cast<std::size_t>(y) * static_cast<std::size_t>(layout.width)],
                    layout, wanted_row, gains, {begin, of_row});
      }
      for (const schemas::HotPixel& pixel : std::span(first_dark, dark)) {
        if (wanted_row[pixel.x / layout.mcu_width] != 0 && exceeds_limit(pixel)) {
          replace_by_neighbours(rgba, layout, pixel, {first_dark, dark});
        }
      }
    }
  }

 private:
  static constexpr int kChunk = 128;  // pixels; their values stay in the L1 cache
  using Values = std::array<float, kChunk>;

  void correct_row(std::uint16_t* row, const JpegLayout& layout, const std::uint8_t* wanted,
                   const std::vector<float>& gains, std::span<const schemas::HotPixel> dark) const {
    for (int mcu = 0; mcu < layout.mcus_per_row;) {
      int end = mcu;
      while (end < layout.mcus_per_row && wanted[end] != 0) ++end;
      const int right = std::min(end * layout.mcu_width, layout.width);
      for (int x = mcu * layout.mcu_width; x < right; x += kChunk) {
        correct_chunk(row, x, std::min(kChunk, right - x), gains, dark);
      }
      mcu = end + 1;
    }
  }

  void correct_chunk(std::uint16_t* row, int x, int count, const std::vector<float>& gains,
                     std::span<const schemas::HotPixel> dark) const {
    std::array<Values, 3> shown, light;
    std::uint16_t* const pixels = row + 4 * static_cast<std::ptrdiff_t>(x);
    for (int i = 0; i < count; ++i) {
      for (std::size_t c = 0; c < 3; ++c) {
        shown[c][i] = light_[c][pixels[4 * i + static_cast<std::ptrdiff_t>(c)]];
      }
    }
    for (const schemas::HotPixel& pixel : dark) {
      if (pixel.x < x || pixel.x >= x + count) continue;
      for (std::size_t c = 0; c < 3; ++c) {
        shown[c][pixel.x - x] -= contrast_[c] * static_cast<float>(pixel.light[c]);
      }
    }
    const std::size_t width = gains.size() / 3;
    for (std::size_t c = 0; gains_ && c < 3; ++c) {
      const float* const gain = &gains[c * width + static_cast<std::size_t>(x)];
      for (int i = 0; i < count; ++i) shown[c][i] *= gain[i];
    }
    for (std::size_t c = 0; c < 3; ++c) {
      const auto [r, g, b] = matrix_[c];
      for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) {
        const float part =
            std::clamp(r * shown[0][i] + g * shown[1][i] + b * shown[2][i], 0.F, 1.F);
        light[c][i] = std::sqrt(part) * static_cast<float>(kLevels - 1) + 0.5F;
      }
    }
    for (int i = 0; i < count; ++i) {
      for (std::size_t c = 0; c < 3; ++c) {
        pixels[4 * i + static_cast<std::ptrdiff_t>(c)] = (*levels_)[static_cast<int>(light[c][i])];
      }
    }
  }

  /// Replaces a pixel by the mean of its neighbours within the MCU that are not nearer to the MCU's
  /// edge. The result thus does not depend on other MCUs. `dark`: hot pixels of the MCU row.
  static void replace_by_neighbours(std::span<std::uint16_t> rgba, const JpegLayout& layout,
                                    const schemas::HotPixel& pixel,
                                    std::span<const schemas::HotPixel> dark) {
    const int left = pixel.x / layout.mcu_width * layout.mcu_width;
    const int top = pixel.y / layout.mcu_height * layout.mcu_height;
    const int right = std::min(left + layout.mcu_width, layout.width) - 1;
    const int bottom = std::min(top + layout.mcu_height, layout.height) - 1;
    const auto from_edge = [&](int x, int y) {
      return std::min(std::min(x - left, right - x), std::min(y - top, bottom - y));
    };
    const auto is_usable = [&](int x, int y) {
      if (x < left || x > right || y < top || y > bottom) return false;
      if (from_edge(x, y) < from_edge(pixel.x, pixel.y)) return false;
      return std::ranges::none_of(dark, [&](const schemas::HotPixel& p) {
        return p.x == x && p.y == y && exceeds_limit(p);
      });
    };
    std::array<std::uint32_t, 3> sum{};
    std::uint32_t count = 0;
    const auto at = [&](int x, int y) {
      return 4 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(layout.width) +
                  static_cast<std::size_t>(x));
    };
    for (int y = pixel.y - 1; y <= pixel.y + 1; ++y) {
      for (int x = pixel.x - 1; x <= pixel.x + 1; ++x) {
        if (!is_usable(x, y)) continue;
        for (std::size_t c = 0; c < 3; ++c) sum[c] += rgba[at(x, y) + c];
        ++count;
      }
    }
    if (count == 0) return;  // inside a cluster: keeps the value after subtraction
    for (std::size_t c = 0; c < 3; ++c) {
      rgba[at(pixel.x, pixel.y) + c] = static_cast<std::uint16_t>((sum[c] + count / 2) / count);
    }
  }

  std::vector<schemas::HotPixel> dark_;
  std::array<float, 3> contrast_{};
  std::array<std::vector<float>, 3> light_{};     ///< per code, before gain and matrix
  std::array<std::array<float, 3>, 3> matrix_{};  ///< divided by the full scale
  LevelTable levels_;
  std::optional<Gains> gains_;
};

LevelTable make_level_table(BlendSpace space) {
  std::vector<std::uint16_t> levels(kLevels);
  for (std::size_t i = 0; i < kLevels; ++i) {
    const double root = static_cast<double>(i) / (kLevels - 1);
    levels[i] = level_of(root * root, {space, 1});
  }
  return std::make_shared<const std::vector<std::uint16_t>>(std::move(levels));
}

bool needs_per_pixel_correction(const schemas::PhotometricResponse& response) {
  return response.vignetting || response.gain_map ||
         response.matrix != schemas::kIdentityColorMatrix || !response.hot_pixels.empty();
}

PhotometricCorrection::PhotometricCorrection(const schemas::PhotometricResponse& response,
                                             rig::PictureSize size,
                                             const schemas::TakeDocument& take,
                                             const CodeScale& scale, LevelTable levels) {
  const bool by_pixel = needs_per_pixel_correction(response);
  for (std::size_t c = 0; c < 3; ++c) {
    for (int code = 0; code < kCodes; ++code) {
      const double light =
          response.brightness[c] + response.contrast[c] * linear_from_code(response, take, c, code);
      table_.code[c][code] = by_pixel ? static_cast<std::uint16_t>(code) : level_of(light, scale);
    }
  }
  if (!by_pixel) return;
  if (!levels) levels = make_level_table(scale.space);
  pixels_ = std::make_shared<const Pixels>(
      response, size, kCodes,
      [&](std::size_t c, int code) { return linear_from_code(response, take, c, code); }, scale,
      std::move(levels));
}

PhotometricCorrection::PhotometricCorrection(const schemas::PhotometricResponse& response,
                                             rig::PictureSize size,
                                             const schemas::PixelEncoding& encoding,
                                             const CodeScale& scale, LevelTable levels) {
  const schemas::PhotometricResponse whole = with_primaries(response, encoding);
  const auto shown = [&](std::size_t c, int sample) {
    return light_by_curve(response.curve[c],
                          light_from_sample(encoding, static_cast<std::uint16_t>(sample)));
  };
  if (needs_per_pixel_correction(whole)) {
    if (!levels) levels = make_level_table(scale.space);
    pixels_ = std::make_shared<const Pixels>(whole, size, static_cast<int>(kSampleValues), shown,
                                             scale, std::move(levels));
    return;
  }
  std::vector<std::uint16_t> table(3 * kSampleValues);
  for (std::size_t c = 0; c < 3; ++c) {
    for (std::size_t sample = 0; sample < kSampleValues; ++sample) {
      const auto value = static_cast<std::uint16_t>(sample);
      table[c * kSampleValues + sample] =
          level_of(light_of_sample(response, encoding, c, value), scale);
    }
  }
  deep_table_ = std::make_shared<const std::vector<std::uint16_t>>(std::move(table));
}

double PhotometricCorrection::light_of_sample(const schemas::PhotometricResponse& response,
                                              const schemas::PixelEncoding& encoding,
                                              std::size_t channel, std::uint16_t sample) {
  const double shown = light_by_curve(response.curve[channel], light_from_sample(encoding, sample));
  return response.brightness[channel] + response.contrast[channel] * shown;
}

void PhotometricCorrection::convert(const DeepPicture& picture,
                                    std::span<std::uint16_t> rgba) const {
  const std::size_t pixels =
      static_cast<std::size_t>(picture.width) * static_cast<std::size_t>(picture.height);
  const std::uint16_t* const from = picture.samples.data();
  constexpr std::uint16_t kOpaque = 65535;
  if (deep_table_) {
    const std::uint16_t* const table = deep_table_->data();
    for (std::size_t i = 0; i < pixels; ++i) {
      for (std::size_t c = 0; c < 3; ++c) {
        rgba[4 * i + c] = table[c * kSampleValues + from[3 * i + c]];
      }
      rgba[4 * i + 3] = kOpaque;
    }
    return;
  }
  for (std::size_t i = 0; i < pixels; ++i) {
    std::copy_n(from + 3 * i, 3, &rgba[4 * i]);
    rgba[4 * i + 3] = kOpaque;
  }
  JpegLayout layout;
  layout.width = picture.width;
  layout.height = picture.height;
  layout.mcus_per_row = (layout.width + layout.mcu_width - 1) / layout.mcu_width;
  layout.mcu_rows = (layout.height + layout.mcu_height - 1) / layout.mcu_height;
  correct(rgba, layout, McuMask(static_cast<std::size_t>(layout.mcu_count()), 1));
}

void PhotometricCorrection::correct(std::span<std::uint16_t> rgba, const JpegLayout& layout,
                                    const McuMask& wanted) const {
  if (pixels_) pixels_->correct(rgba, layout, wanted);
}

std::array<std::uint16_t, 3> PhotometricCorrection::reference(
    const schemas::PhotometricResponse& response, rig::PictureSize size,
    const schemas::TakeDocument& take, const CodeScale& scale, int x, int y,
    const std::array<std::uint8_t, 3>& code) {
  schemas::Rgb shown{}, dark{};
  for (std::size_t c = 0; c < 3; ++c) shown[c] = linear_from_code(response, take, c, code[c]);
  for (const schemas::HotPixel& pixel : response.hot_pixels) {
    if (pixel.x == x && pixel.y == y) dark = pixel.light;
  }
  const schemas::Rgb light = rig::apply_photometric_correction(response, size, x, y, shown, dark);
  std::array<std::uint16_t, 3> levels{};
  for (std::size_t c = 0; c < 3; ++c) levels[c] = level_of(light[c], scale);
  return levels;
}

std::array<std::uint16_t, 3> PhotometricCorrection::reference(
    const schemas::PhotometricResponse& response, rig::PictureSize size,
    const schemas::PixelEncoding& encoding, const CodeScale& scale, int x, int y,
    const std::array<std::uint16_t, 3>& sample) {
  schemas::Rgb shown{}, dark{};
  for (std::size_t c = 0; c < 3; ++c) {
    shown[c] = light_by_curve(response.curve[c], light_from_sample(encoding, sample[c]));
  }
  for (const schemas::HotPixel& pixel : response.hot_pixels) {
    if (pixel.x == x && pixel.y == y) dark = pixel.light;
  }
  const schemas::Rgb light = rig::apply_photometric_correction(with_primaries(response, encoding),
                                                               size, x, y, shown, dark);
  std::array<std::uint16_t, 3> levels{};
  for (std::size_t c = 0; c < 3; ++c) levels[c] = level_of(light[c], scale);
  return levels;
}

}  // namespace raystage::store
