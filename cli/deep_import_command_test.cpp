// SPDX-License-Identifier: Apache-2.0
// `raystage import` of images and movies of more than 8 bits that FFmpeg wrote: what a take holds
// is compared with the samples that FFmpeg was given.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <random>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "base/atomic_file.h"
#include "base/half_float.h"
#include "schemas/pixel_encoding.h"
#include "store/take.h"
#include "testing/cli/test_command.h"
#include "testing/test_folder.h"

namespace raystage::testing {
namespace {

namespace fs = std::filesystem;
using schemas::PixelEncoding;

constexpr int kWidth = 96, kHeight = 64, kFrames = 3;
constexpr std::size_t kPixels = std::size_t{kWidth} * kHeight;

/// Returns values as a file of raw video has them.
template <class T>
std::string raw_bytes(const std::vector<T>& values) {
  const auto bytes = std::as_bytes(std::span(values));
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

class DeepImportCommand : public ::testing::Test {
 protected:
  fs::path path(const std::string& name) const { return folder_.path() / name; }
  std::string quoted(const std::string& name) const { return "'" + path(name).string() + "'"; }

  /// Encodes raw frames by FFmpeg. `format`: of the raw pixels; `options`: of the encoder.
  void encode(const std::string& raw, const std::string& format, const std::string& options,
              const std::string& file) const {
    write_file_atomically(path("raw"), raw);
    const CommandResult encoded =
        run_in_shell("ffmpeg -nostdin -v error -y -f rawvideo -pix_fmt " + format +
                     " -video_size " + std::to_string(kWidth) + "x" + std::to_string(kHeight) +
                     " -framerate 15 -i " + quoted("raw") + " " + options + " " + quoted(file));
    ASSERT_EQ(encoded.exit_code, 0) << encoded.output;
  }
  /// Imports a camera with these images or this movie as the take `name`.
  store::Take import(const std::string& name, nlohmann::json source, const std::string& color_space,
                     const std::string& options = "") const {
    source.update(
        {{"id", "a"},
         {"width", kWidth},
         {"height", kHeight},
         {"intrinsics", {{"fx", 80}, {"fy", 80}, {"cx", 48}, {"cy", 32}}},
         {"world_from_camera", {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}}}});
    const nlohmann::json manifest{{"schema", "raystage/import/1"},       {"name", "deep"},
                                  {"epoch_utc", "2026-01-01T00:00:00Z"}, {"nominal_fps", 15},
                                  {"color_space", color_space},          {"cameras", {source}}};
    write_file_atomically(path(name + ".json"), manifest.dump());
    const CommandResult imported =
        run_raystage("import -q " + quoted(name + ".json") + " -o " + quoted(name) + " " + options);
    EXPECT_EQ(imported.exit_code, 0) << imported.output;
    return store::Take(path(name));
  }
  static nlohmann::json one_image(const std::string& file) {
    return {{"frames", {{{"file", file}, {"time_ns", 0}}}}};
  }
  /// Returns the samples of all frames.
  static std::vector<std::uint16_t> samples_of(const store::Take& take) {
    std::vector<std::uint16_t> samples;
    for (std::size_t i = 0; i < take.archive(0).frames().size(); ++i) {
      const store::DeepPicture picture = take.archive(0).picture(static_cast<int>(i));
      samples.insert(samples.end(), picture.samples.begin(), picture.samples.end());
    }
    return samples;
  }
  static std::size_t distinct(const std::vector<std::uint16_t>& codes) {
    return std::set<std::uint16_t>(codes.begin(), codes.end()).size();
  }

  TestFolder folder_;
  std::mt19937 random_{41};  // NOLINT: the same in every run
};

TEST_F(DeepImportCommand, TiffOf16BitsIsStoredExactly) {
  std::vector<std::uint16_t> codes(3 * kPixels);
  for (std::uint16_t& code : codes) code = static_cast<std::uint16_t>(random_());
  ASSERT_NO_FATAL_FAILURE(encode(raw_bytes(codes), "rgb48le", "-c:v tiff", "a.tif"));
  const store::Take take = import("take", one_image("a.tif"), "srgb_texture");
  const PixelEncoding pixels = take.document().cameras[0].pixels.value();
  EXPECT_EQ(pixels.samples, PixelEncoding::Samples::kInteger);
  EXPECT_EQ(pixels.bits, 16);
  EXPECT_EQ(pixels.transfer, PixelEncoding::Transfer::kSrgb);
  EXPECT_EQ(samples_of(take), codes);
  EXPECT_GT(distinct(codes), 10'000U);
}

struct DeepMovie {
  const char* name;
  const char* encoder;
  const char* file;
  bool is_full_range;
};

class DeepMovieImport : public DeepImportCommand,
                        public ::testing::WithParamInterface<DeepMovie> {};

/// From the 12-bit R'G'B' of the take, the 10-bit codes that were encoded come back exactly, by
/// ITU-R BT.709.
TEST_P(DeepMovieImport, YuvOf10BitsKeepsEveryCode) {
  constexpr double kRed = 0.2126, kBlue = 0.0722, kLargest = 4095;
  const bool is_full = GetParam().is_full_range;
  const double black = is_full ? 0 : 64, luma_range = is_full ? 1023 : 876,
               chroma_range = is_full ? 1023 : 896;
  // Within the gamut, so that nothing is clipped.
  constexpr int kGrey = 512, kFirst = 152, kCodes = 700, kSwing = 44;
  std::vector<std::uint16_t> planes;
  for (int frame = 0; frame < kFrames; ++frame) {
    for (std::size_t i = 0; i < 3 * kPixels; ++i) {
      planes.push_back(static_cast<std::uint16_t>(
          i < kPixels ? kFirst + random_() % kCodes : kGrey - kSwing + random_() % (2 * kSwing)));
    }
  }
  ASSERT_NO_FATAL_FAILURE(encode(
      raw_bytes(planes), "yuv444p10le",
      std::string(GetParam().encoder) + " -pix_fmt yuv444p10le -color_range " +
          (is_full ? "pc" : "tv") + " -colorspace bt709 -color_primaries bt709 -color_trc bt709",
      GetParam().file));
  const store::Take take = import("take", {{"movie", GetParam().file}}, "srgb_texture");
  EXPECT_EQ(take.document().cameras[0].pixels.value().bits, 12);
  const std::vector<std::uint16_t> samples = samples_of(take);
  ASSERT_EQ(samples.size(), planes.size());
  std::vector<std::uint16_t> luma;
  int different = 0;
  for (std::size_t pixel = 0; pixel < samples.size() / 3; ++pixel) {
    const double r = samples[3 * pixel] / kLargest, g = samples[3 * pixel + 1] / kLargest,
                 b = samples[3 * pixel + 2] / kLargest;
    const double y = kRed * r + (1 - kRed - kBlue) * g + kBlue * b;
    const double found[]{black + luma_range * y, kGrey + chroma_range * (b - y) / (2 * (1 - kBlue)),
                         kGrey + chroma_range * (r - y) / (2 * (1 - kRed))};
    const std::size_t at = pixel / kPixels * 3 * kPixels + pixel % kPixels;
    for (std::size_t c = 0; c < 3; ++c) {
      different += std::lround(found[c]) == planes[at + c * kPixels] ? 0 : 1;
    }
    luma.push_back(static_cast<std::uint16_t>(std::lround(found[0])));
  }
  EXPECT_EQ(different, 0);
  EXPECT_EQ(distinct(luma), std::size_t{kCodes});
}

INSTANTIATE_TEST_SUITE_P(
    Codecs, DeepMovieImport,
    ::testing::Values(DeepMovie{"ffv1", "-c:v ffv1", "a.mkv", false},
                      DeepMovie{"ffv1_full_range", "-c:v ffv1", "a.mkv", true},
                      DeepMovie{"hevc", "-c:v libx265 -x265-params lossless=1:log-level=none",
                                "a.mov", false}),
    [](const auto& test) { return test.param.name; });

TEST_F(DeepImportCommand, RgbMovieOf10BitsKeepsEveryCode) {
  std::vector<std::uint16_t> planes;  // G, B, R
  for (std::size_t i = 0; i < 3 * kPixels * kFrames; ++i) planes.push_back(random_() % 1024);
  ASSERT_NO_FATAL_FAILURE(encode(raw_bytes(planes), "gbrp10le", "-c:v ffv1", "a.mkv"));
  const std::vector<std::uint16_t> samples =
      samples_of(import("take", {{"movie", "a.mkv"}}, "srgb_texture"));
  ASSERT_EQ(samples.size(), planes.size());
  int different = 0;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const std::size_t pixel = i / 3, plane = (i % 3 + 2) % 3;
    const std::size_t at = pixel / kPixels * 3 * kPixels + plane * kPixels + pixel % kPixels;
    different += std::lround(samples[i] * 1023.0 / 4095) == planes[at] ? 0 : 1;
  }
  EXPECT_EQ(different, 0);
  EXPECT_EQ(distinct(samples), 1024U);
}

TEST_F(DeepImportCommand, GreyMovieOf10BitsKeepsEveryCode) {
  std::vector<std::uint16_t> codes;
  for (std::size_t i = 0; i < kPixels * kFrames; ++i) codes.push_back(random_() % 1024);
  ASSERT_NO_FATAL_FAILURE(encode(raw_bytes(codes), "gray10le", "-c:v ffv1", "a.mkv"));
  const std::vector<std::uint16_t> samples =
      samples_of(import("take", {{"movie", "a.mkv"}}, "srgb_texture"));
  ASSERT_EQ(samples.size(), 3 * codes.size());
  int different = 0;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    different += std::lround(samples[i] * 1023.0 / 4095) == codes[i / 3] ? 0 : 1;
  }
  EXPECT_EQ(different, 0);
}

/// Light from 0.2 to 0.23 along the rows, to 40 times as much down the columns.
std::vector<float> ramps() {
  std::vector<float> planes(3 * kPixels);
  for (std::size_t i = 0; i < planes.size(); ++i) {
    const auto x = static_cast<double>(i % kWidth),
               y = std::floor(static_cast<double>(i % kPixels) / kWidth);
    planes[i] =
        static_cast<float>((0.2 + 0.03 * x / (kWidth - 1)) * std::pow(40, y / (kHeight - 1)));
  }
  return planes;
}

struct LossBound {
  double distance;                   ///< Butteraugli
  double largest_error, mean_error;  ///< of light, as a share of it
  std::size_t codes_in_row;          ///< at least so many of the first row differ
};

TEST_F(DeepImportCommand, ExrWithLossKeepsLightWithinABound) {
  const std::vector<float> planes = ramps();  // G, B, R
  ASSERT_NO_FATAL_FAILURE(
      encode(raw_bytes(planes), "gbrpf32le", "-c:v exr -format float", "a.exr"));
  std::uintmax_t bytes_before = std::numeric_limits<std::uintmax_t>::max();
  // The first row has 9 codes in 8-bit sRGB. Without loss, light is rounded to half floats.
  for (const LossBound& bound :
       {LossBound{0, 1.0 / 2048, 1.0 / 2048, kWidth}, LossBound{0.1, 0.01, 0.002, kWidth / 2},
        LossBound{1, 0.05, 0.01, 20}}) {
    SCOPED_TRACE(bound.distance);
    const std::string distance = nlohmann::json(bound.distance).dump();
    const store::Take take =
        import("take" + distance, one_image("a.exr"), "lin_rec709_scene", "--distance " + distance);
    EXPECT_EQ(take.document().cameras[0].pixels.value().samples, PixelEncoding::Samples::kHalf);
    const std::vector<std::uint16_t> samples = samples_of(take);
    ASSERT_EQ(samples.size(), planes.size());
    double largest = 0, sum = 0;
    for (std::size_t i = 0; i < samples.size(); ++i) {
      const double wanted = planes[(i % 3 + 2) % 3 * kPixels + i / 3];
      const double error = std::abs(float_from_half(samples[i]) / wanted - 1);
      largest = std::max(largest, error);
      sum += error;
    }
    EXPECT_LE(largest, bound.largest_error);
    EXPECT_LE(sum / static_cast<double>(samples.size()), bound.mean_error);
    EXPECT_GE(distinct({samples.begin(), samples.begin() + 3 * kWidth}), bound.codes_in_row);
    const std::uintmax_t bytes = fs::file_size(path("take" + distance) / "archive/a.mkv");
    EXPECT_LT(bytes, bytes_before);
    bytes_before = bytes;
  }
}

}  // namespace
}  // namespace raystage::testing
