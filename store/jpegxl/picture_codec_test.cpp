// SPDX-License-Identifier: Apache-2.0
#include "store/jpegxl/picture_codec.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <stdexcept>

#include "base/error.h"
#include "base/half_float.h"
#include "base/resources.h"
#include "store/jpegxl/picture_coding.h"
#include "testing/child_limits.h"

namespace raystage::store {
namespace {

using schemas::PixelEncoding;
using ::testing::HasSubstr;

PixelEncoding integers(int bits) {
  return {PixelEncoding::Samples::kInteger, bits, PixelEncoding::Transfer::kSrgb, {}, 1};
}

/// A ramp with noise, of all magnitudes if half.
DeepPicture deep_picture(const PixelEncoding& encoding, int width = 96, int height = 64) {
  DeepPicture picture{width, height, {}};
  std::mt19937 random(7);
  for (int i = 0; i < 3 * width * height; ++i) {
    if (encoding.samples == PixelEncoding::Samples::kInteger) {
      picture.samples.push_back(static_cast<std::uint16_t>(
          (static_cast<unsigned>(i) * 7 + random() % 64) % (encoding.largest_code() + 1U)));
    } else {
      const double light = std::exp2(-14.0 + 28.0 * (i % (3 * width)) / (3.0 * width)) *
                           (1 + 0.01 * (random() % 100));
      picture.samples.push_back(half_from_float(static_cast<float>(std::min(light, 65504.0))));
    }
  }
  return picture;
}

std::string decode_error(std::span<const std::byte> stream, int width, int height,
                         const PixelEncoding* expected = nullptr) {
  try {
    PictureCodec().decode(stream, width, height, expected, "a");
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
    return error.what();
  }
  return "";
}

TEST(PictureCodec, ReturnsEveryBitOfEveryDepth) {
  const PictureCodec codec;
  std::vector<PixelEncoding> encodings{PixelEncoding{}};
  for (int bits = PixelEncoding::kMinBits; bits <= PixelEncoding::kMaxBits; ++bits) {
    encodings.push_back(integers(bits));
  }
  encodings.push_back({});
  encodings.back().chromaticities = {0.713, 0.293, 0.165, 0.83, 0.128, 0.044, 0.32168, 0.33767};
  for (const PixelEncoding& encoding : encodings) {
    const DeepPicture picture = deep_picture(encoding);
    for (const int effort : {1, 3, 7}) {
      const auto stream = codec.encode(picture, encoding, {.effort = effort}, "a");
      EXPECT_TRUE(is_jpeg_xl_picture(stream));
      EXPECT_EQ(codec.decode(stream, 96, 64, &encoding, "a"), picture)
          << encoding.bits << " " << effort;
    }
  }
}

TEST(PictureCodec, ReturnsHalvesThatAreTinyNegativeOrZero) {
  DeepPicture picture{256, 1, {}};
  for (unsigned i = 0; i < 768; ++i) {
    auto bits = static_cast<std::uint16_t>(i * 85U);
    if (!is_finite_half(bits)) bits = 0;
    picture.samples.push_back(bits);
  }
  picture.samples[0] = 0x8000;
  picture.samples[1] = 0x0001;
  const PictureCodec codec;
  const auto stream = codec.encode(picture, {}, {}, "a");
  EXPECT_EQ(codec.decode(stream, 256, 1, nullptr, "a"), picture);
}

TEST(PictureCodec, KeepsLightAtADistanceNearlyAndSmaller) {
  const PixelEncoding half;
  DeepPicture picture{128, 128, {}};
  std::mt19937 random(5);
  for (int i = 0; i < 3 * 128 * 128; ++i) {
    const double noise = 0.05 * (random() % 100) / 100.0;
    picture.samples.push_back(
        half_from_float(static_cast<float>((4 + 3 * std::sin((i / 3 % 128) * 0.1)) * (1 + noise))));
  }
  const PictureCodec codec;
  const auto exact = codec.encode(picture, half, {}, "a");
  const auto lossy = codec.encode(picture, half, {.distance = 1}, "a");
  EXPECT_LT(lossy.size(), exact.size());
  const DeepPicture again = codec.decode(lossy, 128, 128, &half, "a");
  double worst = 0;
  for (std::size_t i = 0; i < picture.samples.size(); ++i) {
    const double was = static_cast<double>(float_from_half(picture.samples[i]));
    const double is = static_cast<double>(float_from_half(again.samples[i]));
    worst = std::max(worst, std::abs(is / was - 1));
  }
  EXPECT_GT(worst, 0);
  EXPECT_LT(worst, 0.1);
}

TEST(PictureCodec, RefusesOtherPicturesAndDamage) {
  const PixelEncoding half;
  const PictureCodec codec;
  const auto stream = codec.encode(deep_picture(half), half, {}, "a");
  const PixelEncoding ten = integers(10);
  EXPECT_THAT(decode_error(stream, 96, 64, &ten), HasSubstr("another form"));
  EXPECT_THAT(decode_error(stream, 96, 63), HasSubstr("96 x 64"));
  EXPECT_THAT(decode_error(stream, 128, 64), HasSubstr("96 x 64"));
  EXPECT_NE(decode_error({}, 96, 64), "");
  for (std::size_t size = 0; size < stream.size(); size += 1 + stream.size() / 16) {
    EXPECT_NE(decode_error(std::span(stream).first(size), 96, 64), "") << size;
  }
}

TEST(PictureCodec, MutatedFilesNeverGiveValuesThatAreNotFinite) {
  const PixelEncoding half;
  const PictureCodec codec;
  const auto stream = codec.encode(deep_picture(half), half, {}, "a");
  int refused = 0;
  for (std::size_t bit = 16; bit < 8 * stream.size(); bit += 1 + stream.size() / 16) {
    std::vector<std::byte> mutated = stream;
    mutated[bit / 8] ^= static_cast<std::byte>(1U << (bit % 8));
    try {
      const DeepPicture picture = codec.decode(mutated, 96, 64, &half, "a");
      EXPECT_TRUE(std::ranges::all_of(picture.samples, is_finite_half));
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
      ++refused;
    }
  }
  EXPECT_GT(refused, 0);
}

TEST(PictureCodec, InfiniteSamplesAreNotEncoded) {
  DeepPicture picture = deep_picture({});
  picture.samples[100] = 0x7C00;
  EXPECT_THROW(encode_picture(picture, {}, {}), std::runtime_error);
}

TEST(PictureCodec, HugePicturesCostNoMemory) {
  const auto stream = encode_picture(deep_picture({}), {}, {});
  EXPECT_THROW(decode_picture(stream, 96 * 64 - 1), std::runtime_error);
  EXPECT_EQ(decode_picture(stream, 96 * 64).picture, deep_picture({}));
}

/// A rig states any size.
TEST(PictureCodec, HugeCamerasGrantNoMoreThanHalfOfTheMachine) {
  const PictureCodec codec;
  const auto stream = encode_picture(deep_picture({}), {}, {});
  EXPECT_THROW(codec.decode(stream, 65535, 65535, nullptr, "a"), Error);
  if (!testing::kDecodersHaveLimits) GTEST_SKIP() << "decoders have no limits in this build";
  const std::uint64_t limit = testing::largest_data_limit_of_decoders();
  EXPECT_GT(limit, std::uint64_t{256} << 20);
  EXPECT_LT(limit, available_memory() / 2 + (std::uint64_t{1} << 30));
}

TEST(HalfFloat, ConvertsEveryHalfAndRoundsToTheNearest) {
  for (unsigned bits = 0; bits < 65536; ++bits) {
    const auto half = static_cast<std::uint16_t>(bits);
    if (!is_finite_half(half)) continue;
    const float value = float_from_half(half);
    EXPECT_EQ(half_from_float(value), half) << bits;
    const auto next = static_cast<std::uint16_t>(half + 1);
    if (!is_finite_half(next)) continue;
    const double between = (double{value} + double{float_from_half(next)}) / 2;
    const auto even = (half & 1U) == 0 ? half : next;
    EXPECT_EQ(half_from_float(static_cast<float>(between)), even) << bits;
    EXPECT_EQ(half_from_float(std::nextafter(static_cast<float>(between), value)), half) << bits;
  }
  EXPECT_EQ(half_from_float(1e6F), 0x7C00);
  EXPECT_EQ(half_from_float(65519.9F), half_from_float(65504));
}

}  // namespace
}  // namespace raystage::store
