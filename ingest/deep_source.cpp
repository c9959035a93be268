// SPDX-License-Identifier: Apache-2.0
// Reads pictures of more than 8 bits for import. EXR files come through OpenEXR with their
// chromaticities; other images through OpenImageIO as floats, from which 16-bit integers return
// exactly.
#include "ingest/deep_source.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/half_float.h"
#include "store/pixel_light.h"

namespace raystage::ingest {
namespace {

using schemas::PixelEncoding;
using Samples = PixelEncoding::Samples;
using Transfer = PixelEncoding::Transfer;

constexpr std::array<images::ExrChannel, 3> kRgb{{{"R"}, {"G"}, {"B"}}};
constexpr const char* kExrAdvice = "Give an EXR file with the channels R, G, B";
constexpr std::array<double, 8> kBt2020{0.708, 0.292, 0.170, 0.797, 0.131, 0.046, 0.3127, 0.3290};

bool is_exr(const std::filesystem::path& file) {
  constexpr std::array<unsigned char, 4> kMagic{0x76, 0x2F, 0x31, 0x01};
  std::array<char, 4> start{};
  std::ifstream(file, std::ios::binary).read(start.data(), start.size());
  return std::ranges::equal(
      start, kMagic, [](char a, unsigned char b) { return static_cast<unsigned char>(a) == b; });
}

std::optional<std::array<double, 8>> chromaticities_of(const images::ExrChannelData& data) {
  if (!data.chromaticities) return std::nullopt;
  constexpr std::array<float, 8> kRec709{0.64F, 0.33F, 0.30F, 0.60F, 0.15F, 0.06F, 0.3127F, 0.329F};
  constexpr float kSame = 2e-4F;
  const bool is_rec709 = std::ranges::equal(
      *data.chromaticities, kRec709, [](float a, float b) { return std::abs(a - b) <= kSame; });
  if (is_rec709) return std::nullopt;
  std::array<double, 8> result{};
  std::ranges::transform(*data.chromaticities, result.begin(),
                         [](float value) { return std::round(value * 1e6) / 1e6; });
  return result;
}

/// Appends a value of linear light as a half float.
void append_half(float value, DeepSource& source) {
  float finite = std::clamp(value, -kLargestHalf, kLargestHalf);
  if (!std::isfinite(value)) {
    ++source.not_finite;
    if (std::isnan(value)) finite = 0;
  }
  // One infinite sample must not take codes from the others: it is shown at their peak.
  if (std::isfinite(value)) source.peak = std::max(source.peak, static_cast<double>(finite));
  source.picture.samples.push_back(half_from_float(finite));
}

/// Sets the peak of a picture of integers.
DeepSource with_peak(store::DeepPicture picture, const PixelEncoding& encoding) {
  const std::uint16_t largest = *std::ranges::max_element(picture.samples);
  return {std::move(picture), store::light_from_sample(encoding, largest), 0};
}

}  // namespace

std::optional<PixelEncoding> deep_encoding_of_image(const images::ImageReader& reader,
                                                    const images::ExrReader& exr_reader,
                                                    const std::filesystem::path& file,
                                                    bool linear) {
  const images::ImageProperties properties = reader.properties(file);
  PixelEncoding encoding;
  if (properties.holds_integers()) {
    if (properties.type == images::PixelType::kUint8) return std::nullopt;
    encoding.samples = Samples::kInteger;
    encoding.transfer = linear ? Transfer::kLinear : Transfer::kSrgb;
    return encoding;
  }
  if (!linear) return std::nullopt;
  if (is_exr(file) && exr_reader.has_channels(file, kRgb)) {
    encoding.chromaticities = chromaticities_of(exr_reader.read(file, kRgb, kExrAdvice));
    store::rec709_from(encoding);  // throws if they span no colours
  }
  return encoding;
}

std::optional<PixelEncoding> deep_encoding_of_movie(const MovieFormat& format) {
  constexpr int kJpegBits = 8, kMoreBits = 2;
  if (format.bits <= kJpegBits) return std::nullopt;
  PixelEncoding encoding;
  encoding.samples = Samples::kInteger;
  encoding.bits = std::min(format.bits + kMoreBits, PixelEncoding::kMaxBits);
  encoding.transfer = format.transfer;
  if (format.has_bt2020_primaries) encoding.chromaticities = kBt2020;
  return encoding;
}

DeepSource read_deep_image(const images::ImageReader& reader, const images::ExrReader& exr_reader,
                           const std::filesystem::path& file, SourceImageSize size,
                           const PixelEncoding& encoding) {
  DeepSource source;
  store::DeepPicture& picture = source.picture;
  const bool is_half = encoding.samples == Samples::kHalf;
  if (is_half && is_exr(file) && exr_reader.has_channels(file, kRgb)) {
    const images::ExrChannelData data = exr_reader.read(file, kRgb, kExrAdvice);
    check_image_size({data.width, data.height}, size, file.string());
    if (chromaticities_of(data) != encoding.chromaticities) {
      throw Error::bad_input("the image has other primaries than the first one of its camera",
                             file.string(), "Convert the images of a camera to the same primaries");
    }
    for (const float value : data.values) append_half(value, source);
    picture.width = data.width;
    picture.height = data.height;
    return source;
  }
  const images::ImageProperties properties = reader.properties(file);
  check_image_size({properties.width, properties.height}, size, file.string());
  if (properties.holds_integers() == is_half) {
    throw Error::bad_input("the image has another form of samples than the first one of its camera",
                           file.string(), "Give all images of a camera floats, or all integers");
  }
  const images::ImageValues<float> values = reader.read_floats(file);
  const auto channels = static_cast<std::size_t>(values.properties.channels);
  picture.width = values.properties.width;
  picture.height = values.properties.height;
  picture.samples.reserve(3 * values.properties.pixels());
  const auto largest = static_cast<float>(encoding.largest_code());
  for (std::size_t pixel = 0; pixel < values.properties.pixels(); ++pixel) {
    for (std::size_t c = 0; c < 3; ++c) {
      const float value = values.values[pixel * channels + (channels >= 3 ? c : 0)];
      if (is_half) {
        append_half(value, source);
      } else {
        picture.samples.push_back(
            static_cast<std::uint16_t>(std::clamp(value, 0.0F, 1.0F) * largest + 0.5F));
      }
    }
  }
  return is_half ? std::move(source) : with_peak(std::move(picture), encoding);
}

DeepSource deep_source_of_movie(const store::DeepPicture& picture, const PixelEncoding& encoding) {
  constexpr std::uint32_t kFullScale = 65535;
  const auto largest = static_cast<std::uint32_t>(encoding.largest_code());
  store::DeepPicture rounded = picture;
  for (std::uint16_t& sample : rounded.samples) {
    sample =
        static_cast<std::uint16_t>((sample * std::uint64_t{largest} + kFullScale / 2) / kFullScale);
  }
  return with_peak(std::move(rounded), encoding);
}

}  // namespace raystage::ingest
