// SPDX-License-Identifier: Apache-2.0
#include "store/processing/frames/photometric_correction.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <vector>

#include "base/transfer_function.h"
#include "store/jpeg/encode.h"

namespace raystage::store::photometric_correction_test {
namespace {

constexpr int kWidth = 200, kHeight = 72;
constexpr rig::PictureSize kSize{kWidth, kHeight};

RgbImage speckled() {
  RgbImage image{kWidth, kHeight, std::vector<std::uint8_t>()};
  for (int i = 0; i < kWidth * kHeight; ++i) {
    const int x = i % kWidth, y = i / kWidth;
    image.values.push_back(static_cast<std::uint8_t>((3 * x + y) % 256));
    image.values.push_back(static_cast<std::uint8_t>((x + 5 * y) % 256));
    image.values.push_back(static_cast<std::uint8_t>((x * y / 7) % 256));
  }
  return image;
}

struct Decoded {
  RgbImage codes;
  std::vector<std::uint16_t> levels;  // 4 per pixel
};

class Correction : public ::testing::TestWithParam<BlendSpace> {
 protected:
  Correction() {
    take_.color_space = "srgb_texture";
    jpeg_ = encode_jpeg(speckled(), {.quality = 98});
    layout_ = parse_jpeg_layout(jpeg_, "speckled");
  }

  CodeScale scale_of(const schemas::PhotometricResponse& response) const {
    return {GetParam(), std::max(1.0, max_linear_light(response, kSize, take_))};
  }

  Decoded decoded(const schemas::PhotometricResponse& response, const McuMask& wanted) const {
    const PhotometricCorrection correction(response, kSize, take_, scale_of(response));
    Decoded result{JpegDecoder().decode(jpeg_, "speckled"), {}};
    result.levels.assign(4 * kWidth * kHeight, 7);
    JpegDecoder().decode_region(jpeg_, layout_, wanted, correction.table(), result.levels, "");
    correction.correct(result.levels, layout_, wanted);
    return result;
  }
  Decoded decoded(const schemas::PhotometricResponse& response) const {
    return decoded(response, McuMask(static_cast<std::size_t>(layout_.mcu_count()), 1));
  }

  /// Returns the largest difference from the slow reference, of 65535. `left_out`: excluded pixels.
  int worst(const schemas::PhotometricResponse& response,
            const std::vector<int>& left_out = {}) const {
    const Decoded found = decoded(response);
    int most = 0;
    for (int i = 0; i < kWidth * kHeight; ++i) {
      if (std::ranges::find(left_out, i) != left_out.end()) continue;
      const auto at = static_cast<std::size_t>(i);
      const auto expected = PhotometricCorrection::reference(
          response, kSize, take_, scale_of(response), i % kWidth, i / kWidth,
          {found.codes.values[3 * at], found.codes.values[3 * at + 1],
           found.codes.values[3 * at + 2]});
      for (std::size_t c = 0; c < 3; ++c) {
        most = std::max(most, std::abs(expected[c] - found.levels[4 * at + c]));
      }
      EXPECT_EQ(found.levels[4 * at + 3], 65535);
    }
    return most;
  }

  schemas::TakeDocument take_;
  std::vector<std::byte> jpeg_;
  JpegLayout layout_;
};

TEST_P(Correction, CurvesContrastAndBrightnessAreTheTableAlone) {
  schemas::PhotometricResponse response;
  response.contrast = {1.2, 0.8, 1};
  response.brightness = {0.01, -0.02, 0};
  response.curve = {{{0, 0.3, 0.55, 1}, {0.05, 1.1}, {0, 1}}};
  EXPECT_TRUE(PhotometricCorrection(response, kSize, take_, {GetParam(), 1}).is_table_only());
  EXPECT_EQ(worst(response), 0);
}

TEST_P(Correction, GainsMatricesAndDarkPixelsAreAsTheReference) {
  constexpr int kAsPrecise = 12;  // of 65535; one step of a code is 257
  schemas::PhotometricResponse response;
  response.vignetting = schemas::Vignetting{110, 30, {0.35, 0.12, 0.01}};
  EXPECT_FALSE(PhotometricCorrection(response, kSize, take_, {GetParam(), 1}).is_table_only());
  EXPECT_LE(worst(response), kAsPrecise) << "vignetting";

  response = {};
  response.gain_map = schemas::GainMap{
      3, 2, {{1, 1, 1}, {1.2, 1, 1}, {1, 1, 1.3}, {1, 2, 1}, {1, 1, 1}, {0.7, 1, 1}}};
  EXPECT_LE(worst(response), kAsPrecise) << "gain map";

  response = {};
  response.matrix = {{{1.3, -0.2, -0.1}, {-0.1, 1.2, -0.1}, {0.05, -0.3, 1.25}}};
  EXPECT_LE(worst(response), kAsPrecise) << "matrix";

  response = {};
  response.hot_pixels = {{3, 0, {0.1, 0.05, 0}}, {199, 0, {0.2, 0, 0}}, {130, 71, {0, 0, -0.1}}};
  EXPECT_LE(worst(response), kAsPrecise) << "dark pixels";

  response.contrast = {1.2, 0.8, 1};
  response.brightness = {0.01, -0.02, 0};
  response.curve = {{{0, 0.3, 0.55, 1}, {0.05, 1.1}, {0, 1}}};
  response.vignetting = schemas::Vignetting{110, 30, {0.35, 0.12, 0.01}};
  response.matrix = {{{1.3, -0.2, -0.1}, {-0.1, 1.2, -0.1}, {0.05, -0.3, 1.25}}};
  EXPECT_LE(worst(response), kAsPrecise) << "all of them";
}

TEST_P(Correction, PixelsWithoutRangeAreShownAsTheirNeighbours) {
  schemas::PhotometricResponse response;
  response.hot_pixels = {{20, 10, {0, 0.6, 0}}, {48, 11, {1, 1, 1}}, {49, 11, {1, 1, 1}}};
  const std::vector<int> lost{10 * kWidth + 20, 11 * kWidth + 48, 11 * kWidth + 49};
  EXPECT_LE(worst(response, lost), 12);
  const Decoded found = decoded(response);
  const auto level = [&](int x, int y, std::size_t c) {
    return int{found.levels[4 * static_cast<std::size_t>(y * kWidth + x) + c]};
  };
  for (std::size_t c = 0; c < 3; ++c) {
    int least = 65535, most = 0;
    for (const auto& [x, y] :
         {std::pair{19, 9}, {20, 9}, {21, 9}, {19, 10}, {21, 10}, {19, 11}, {20, 11}, {21, 11}}) {
      least = std::min(least, level(x, y, c));
      most = std::max(most, level(x, y, c));
    }
    EXPECT_GE(level(20, 10, c), least);
    EXPECT_LE(level(20, 10, c), most);
    // At an MCU's left edge, neighbours in the MCU to the left and other hot pixels are excluded.
    EXPECT_NEAR(level(48, 11, c),
                (level(48, 10, c) + level(48, 12, c) + level(49, 10, c) + level(49, 12, c)) / 4.0,
                1);
  }
}

TEST_P(Correction, IsTheSameHoweverMuchIsDecoded) {
  schemas::PhotometricResponse response;
  response.vignetting = schemas::Vignetting{110, 30, {0.35, 0.12, 0.01}};
  response.matrix = {{{1.3, -0.2, -0.1}, {-0.1, 1.2, -0.1}, {0.05, -0.3, 1.25}}};
  for (int i = 0; i < 700; ++i) {  // of both kinds, also at edges of MCUs
    const int place = i * 20 + i % 7;
    response.hot_pixels.push_back(
        {place % kWidth, place / kWidth, {i % 3 == 0 ? 0.5 : 0.05, 0.01, 0.02}});
  }
  const Decoded whole = decoded(response);
  McuMask wanted(static_cast<std::size_t>(layout_.mcu_count()), 0);
  for (std::size_t i = 0; i < wanted.size(); ++i) wanted[i] = (i * 7 / 5) % 3 != 0 ? 1 : 0;
  const Decoded part = decoded(response, wanted);
  int looked_at = 0;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const auto is_wanted = [&](int column, int row) {
        column = std::clamp(column, 0, kWidth - 1) / layout_.mcu_width;
        row = std::clamp(row, 0, kHeight - 1) / layout_.mcu_height;
        return wanted[row * layout_.mcus_per_row + column] != 0;
      };
      const auto at = 4 * static_cast<std::size_t>(y * kWidth + x);
      if (!is_wanted(x, y)) {
        EXPECT_EQ(part.levels[at], 7) << "pixels that were not asked for are left alone";
        continue;
      }
      bool far_inside = true;
      for (const int dy : {-2, 0, 2}) {
        for (const int dx : {-2, 0, 2}) far_inside = far_inside && is_wanted(x + dx, y + dy);
      }
      if (!far_inside) continue;
      ++looked_at;
      for (std::size_t c = 0; c < 3; ++c) EXPECT_EQ(part.levels[at + c], whole.levels[at + c]);
    }
  }
  EXPECT_GT(looked_at, 1000);
}

TEST_P(Correction, TheBrightestPixelKeepsItsLight) {
  schemas::PhotometricResponse response;
  response.contrast = {1.2, 0.8, 1};
  response.vignetting = schemas::Vignetting{kWidth / 2.0, kHeight / 2.0, {0.4, 0, 0}};
  response.matrix = {{{1.5, -0.2, -0.3}, {0, 1, 0}, {0, 0, 1}}};
  // The maximum is pure red in the corner.
  EXPECT_NEAR(max_linear_light(response, kSize, take_), 1.2 * 1.4 * 1.5, 1e-3);
  // A single node with a high gain.
  response = {};
  response.gain_map = schemas::GainMap{40, 2, std::vector<schemas::Rgb>(80, {1, 1, 1})};
  response.gain_map->gain[61][1] = 3;
  EXPECT_NEAR(max_linear_light(response, kSize, take_), 3, 1e-12);
  EXPECT_NEAR(max_linear_light({}, kSize, take_), 1, 1e-12);
}

INSTANTIATE_TEST_SUITE_P(BothSpaces, Correction,
                         ::testing::Values(BlendSpace::kPerceptual, BlendSpace::kLinear),
                         [](const auto& space) {
                           return space.param == BlendSpace::kLinear ? "linear" : "perceptual";
                         });

TEST(DeepCorrection, AgreesWithTheReferenceAndKeepsLightAboveWhite) {
  schemas::PixelEncoding half;
  half.peak = 100;
  schemas::PixelEncoding wide = half;
  wide.chromaticities = {0.713, 0.293, 0.165, 0.83, 0.128, 0.044, 0.32168, 0.33767};
  const schemas::PixelEncoding twelve{
      schemas::PixelEncoding::Samples::kInteger, 12, schemas::PixelEncoding::Transfer::kPq, {}, 49};
  schemas::PhotometricResponse plain, whole;
  plain.contrast = {1.1, 0.9, 1};
  plain.curve[1] = {0, 0.4, 1};
  whole = plain;
  whole.vignetting = schemas::Vignetting{20, 10, {0.4, 0.1, 0}};
  whole.hot_pixels = {{3, 2, {0.01, 0.02, 0.03}}};
  constexpr rig::PictureSize kDeepSize{40, 20};
  DeepPicture picture{kDeepSize.width, kDeepSize.height, {}};
  for (unsigned i = 0; i < 3U * 40 * 20; ++i) {
    picture.samples.push_back(static_cast<std::uint16_t>((i * 977U) % 0x5640U));  // up to 100
  }
  for (const schemas::PixelEncoding& encoding : {half, wide, twelve}) {
    for (const schemas::PhotometricResponse& response : {plain, whole}) {
      for (const BlendSpace space :
           {BlendSpace::kPerceptual, BlendSpace::kLinear, BlendSpace::kHighRange}) {
        const CodeScale scale{space, max_linear_light(response, kDeepSize, encoding)};
        EXPECT_GT(scale.full_scale, 40);
        std::vector<std::uint16_t> levels(4 * 40 * 20);
        PhotometricCorrection(response, kDeepSize, encoding, scale).convert(picture, levels);
        int worst = 0;
        for (int i = 0; i < 40 * 20; ++i) {
          const auto at = static_cast<std::size_t>(i);
          const auto expected = PhotometricCorrection::reference(
              response, kDeepSize, encoding, scale, i % 40, i / 40,
              {picture.samples[3 * at], picture.samples[3 * at + 1], picture.samples[3 * at + 2]});
          for (std::size_t c = 0; c < 3; ++c) {
            worst = std::max(worst, std::abs(int{expected[c]} - int{levels[4 * at + c]}));
          }
          EXPECT_EQ(levels[4 * at + 3], 65535);
        }
        // The pass over pixels rounds the square root of light to 16 bits, which is coarse where
        // the power 1/2.4 of it is steep.
        EXPECT_LE(worst, space == BlendSpace::kHighRange ? 40 : 12);
      }
    }
  }
}

TEST(DeepCorrection, CodesOfEightBitsBecomeTheSameLevels) {
  const schemas::PixelEncoding sixteen{schemas::PixelEncoding::Samples::kInteger,
                                       16,
                                       schemas::PixelEncoding::Transfer::kSrgb,
                                       {},
                                       1};
  schemas::TakeDocument take;
  take.color_space = "srgb_texture";
  const PhotometricCorrection codes({}, {1, 1}, take, {}), deep({}, {1, 1}, sixteen, {});
  for (unsigned code = 0; code < 256; ++code) {
    const auto sample = static_cast<std::uint16_t>(code * 257);
    std::vector<std::uint16_t> levels(4);
    deep.convert({1, 1, {sample, sample, sample}}, levels);
    EXPECT_EQ(levels[0], codes.table().code[0][code]) << code;
  }
}

}  // namespace
}  // namespace raystage::store::photometric_correction_test
