// SPDX-License-Identifier: Apache-2.0
// Pictures of more than 8 bits as JPEG XL files (ISO/IEC 18181), by libjxl. Half floats
// are stored as floats of 17 bits, with a bit more of exponent: libjxl 0.7 loses subnormal numbers,
// of which half floats have some that are not dark (2^-14 of white), and these then are normal.
// Integers pass as 16-bit shares of full scale, as libjxl exchanges them. One thread.
#include "store/jpegxl/picture_coding.h"

#include <jxl/decode.h>
#include <jxl/encode.h>

#include <algorithm>
#include <memory>
#include <new>
#include <stdexcept>
#include <string>

#include "base/half_float.h"

namespace raystage::store {
namespace {

using Samples = schemas::PixelEncoding::Samples;
using Transfer = schemas::PixelEncoding::Transfer;

constexpr std::uint32_t kChannels = 3, kFloatBits = 17, kFloatExponentBits = 6;
constexpr std::uint32_t kFullScale = 65535;

struct DestroyPictureDecoder {
  void operator()(JxlDecoder* decoder) const { JxlDecoderDestroy(decoder); }
};
struct DestroyPictureEncoder {
  void operator()(JxlEncoder* encoder) const { JxlEncoderDestroy(encoder); }
};

JxlPixelFormat format_of(Samples samples) {
  return {kChannels, samples == Samples::kHalf ? JXL_TYPE_FLOAT : JXL_TYPE_UINT16,
          JXL_NATIVE_ENDIAN, 0};
}

/// Converts an integer between full scales, rounded.
std::uint16_t rescaled(std::uint32_t value, std::uint32_t from, std::uint32_t to) {
  return static_cast<std::uint16_t>((value * std::uint64_t{to} + from / 2) / from);
}

JxlColorEncoding color_of(const schemas::PixelEncoding& encoding) {
  JxlColorEncoding color{};
  JxlColorEncodingSetToSRGB(&color, JXL_FALSE);
  switch (encoding.transfer) {
    case Transfer::kLinear:
      color.transfer_function = JXL_TRANSFER_FUNCTION_LINEAR;
      break;
    case Transfer::kSrgb:
      color.transfer_function = JXL_TRANSFER_FUNCTION_SRGB;
      break;
    case Transfer::kPq:
      color.transfer_function = JXL_TRANSFER_FUNCTION_PQ;
      break;
    case Transfer::kHlg:
      color.transfer_function = JXL_TRANSFER_FUNCTION_HLG;
      break;
  }
  if (encoding.chromaticities) {
    const auto& c = *encoding.chromaticities;
    color.primaries = JXL_PRIMARIES_CUSTOM;
    color.white_point = JXL_WHITE_POINT_CUSTOM;
    std::copy_n(&c[0], 2, color.primaries_red_xy);
    std::copy_n(&c[2], 2, color.primaries_green_xy);
    std::copy_n(&c[4], 2, color.primaries_blue_xy);
    std::copy_n(&c[6], 2, color.white_point_xy);
  }
  return color;
}

void require_encoded(JxlEncoderStatus status, const char* what) {
  if (status != JXL_ENC_SUCCESS) throw std::runtime_error(what);
}

std::vector<std::byte> output_of(JxlEncoder* encoder, std::size_t first_size) {
  std::vector<std::byte> stream(first_size);
  std::size_t used = 0;
  for (;;) {
    auto* next = reinterpret_cast<std::uint8_t*>(stream.data()) + used;
    std::size_t space = stream.size() - used;
    const JxlEncoderStatus status = JxlEncoderProcessOutput(encoder, &next, &space);
    used = stream.size() - space;
    if (status == JXL_ENC_SUCCESS) break;
    if (status != JXL_ENC_NEED_MORE_OUTPUT)
      throw std::runtime_error("libjxl cannot encode the picture");
    stream.resize(stream.size() * 2);
  }
  stream.resize(used);
  return stream;
}

/// Throws unless a header is that of a picture as encode_picture() writes it.
void check_picture(const JxlBasicInfo& info, std::uint64_t max_pixels) {
  if (info.xsize == 0 || info.ysize == 0 || info.xsize > max_pixels / info.ysize) {
    throw std::runtime_error("it states " + std::to_string(info.xsize) + " x " +
                             std::to_string(info.ysize) +
                             " pixels, which is more than its camera has");
  }
  const bool is_half =
      info.exponent_bits_per_sample == kFloatExponentBits && info.bits_per_sample == kFloatBits;
  const bool is_integer = info.exponent_bits_per_sample == 0 &&
                          info.bits_per_sample >= schemas::PixelEncoding::kMinBits &&
                          info.bits_per_sample <= schemas::PixelEncoding::kMaxBits;
  if (!is_half && !is_integer) {
    throw std::runtime_error(
        "its samples are neither floats of 17 bits nor integers of 9 to 16 bits");
  }
  if (info.num_color_channels != kChannels || info.num_extra_channels != 0) {
    throw std::runtime_error("it has other channels than red, green and blue");
  }
  if (info.have_animation != 0) throw std::runtime_error("it is an animation");
}

}  // namespace

std::vector<std::byte> encode_picture(const DeepPicture& picture,
                                      const schemas::PixelEncoding& encoding,
                                      const PictureCompression& compression) {
  const std::unique_ptr<JxlEncoder, DestroyPictureEncoder> encoder(JxlEncoderCreate(nullptr));
  if (!encoder) throw std::bad_alloc();
  const bool is_half = encoding.samples == Samples::kHalf, is_lossless = compression.distance <= 0;
  JxlBasicInfo info;
  JxlEncoderInitBasicInfo(&info);
  info.xsize = static_cast<std::uint32_t>(picture.width);
  info.ysize = static_cast<std::uint32_t>(picture.height);
  info.bits_per_sample = is_half ? kFloatBits : static_cast<std::uint32_t>(encoding.bits);
  info.exponent_bits_per_sample = is_half ? kFloatExponentBits : 0;
  info.num_color_channels = kChannels;
  info.uses_original_profile = is_lossless ? JXL_TRUE : JXL_FALSE;
  // Samples of more than 12 bits need a higher level of the codestream, which a container states.
  require_encoded(JxlEncoderSetCodestreamLevel(encoder.get(), 10), "libjxl has no level 10");
  require_encoded(JxlEncoderSetBasicInfo(encoder.get(), &info), "libjxl refuses size or depth");
  const JxlColorEncoding color = color_of(encoding);
  require_encoded(JxlEncoderSetColorEncoding(encoder.get(), &color),
                  "libjxl refuses the primaries or transfer function");
  JxlEncoderFrameSettings* const settings =
      JxlEncoderFrameSettingsCreate(encoder.get(), nullptr);  // the encoder owns it
  if (settings == nullptr) throw std::bad_alloc();
  require_encoded(
      JxlEncoderFrameSettingsSetOption(settings, JXL_ENC_FRAME_SETTING_EFFORT, compression.effort),
      "libjxl does not know this effort");
  if (is_lossless) {
    require_encoded(JxlEncoderSetFrameLossless(settings, JXL_TRUE), "libjxl is not lossless");
  } else {
    require_encoded(JxlEncoderSetFrameDistance(settings, static_cast<float>(compression.distance)),
                    "libjxl refuses the distance");
  }
  std::vector<std::uint16_t> integers;
  std::vector<float> floats;
  const auto largest = static_cast<std::uint32_t>(encoding.largest_code());
  for (const std::uint16_t sample : picture.samples) {
    if (is_half) {
      floats.push_back(float_from_half(sample));
    } else {
      integers.push_back(rescaled(std::min<std::uint32_t>(sample, largest), largest, kFullScale));
    }
  }
  const std::span<const std::byte> values =
      is_half ? std::as_bytes(std::span(floats)) : std::as_bytes(std::span(integers));
  const JxlPixelFormat format = format_of(encoding.samples);
  require_encoded(JxlEncoderAddImageFrame(settings, &format, values.data(), values.size()),
                  "libjxl does not accept the picture");
  JxlEncoderCloseInput(encoder.get());
  return output_of(encoder.get(), picture.samples.size() + 4096);
}

CodedPicture decode_picture(std::span<const std::byte> file, std::uint64_t max_pixels) {
  const std::unique_ptr<JxlDecoder, DestroyPictureDecoder> decoder(JxlDecoderCreate(nullptr));
  if (!decoder) throw std::bad_alloc();
  constexpr int kEvents = JXL_DEC_BASIC_INFO | JXL_DEC_FULL_IMAGE;
  if (JxlDecoderSubscribeEvents(decoder.get(), kEvents) != JXL_DEC_SUCCESS ||
      JxlDecoderSetKeepOrientation(decoder.get(), JXL_TRUE) != JXL_DEC_SUCCESS ||
      JxlDecoderSetInput(decoder.get(), reinterpret_cast<const std::uint8_t*>(file.data()),
                         file.size()) != JXL_DEC_SUCCESS) {
    throw std::runtime_error("libjxl does not read it");
  }
  JxlDecoderCloseInput(decoder.get());
  CodedPicture result;
  std::vector<std::uint16_t>& samples = result.picture.samples;
  std::vector<float> floats;
  for (;;) {
    switch (JxlDecoderProcessInput(decoder.get())) {
      case JXL_DEC_BASIC_INFO: {
        JxlBasicInfo info{};
        if (JxlDecoderGetBasicInfo(decoder.get(), &info) != JXL_DEC_SUCCESS)
          throw std::runtime_error("it has no header");
        check_picture(info, max_pixels);
        result.picture.width = static_cast<int>(info.xsize);
        result.picture.height = static_cast<int>(info.ysize);
        result.samples = info.exponent_bits_per_sample > 0 ? Samples::kHalf : Samples::kInteger;
        result.bits = info.exponent_bits_per_sample > 0 ? schemas::PixelEncoding::kMaxBits
                                                        : static_cast<int>(info.bits_per_sample);
        break;
      }
      case JXL_DEC_NEED_IMAGE_OUT_BUFFER: {
        if (result.bits == 0) throw std::runtime_error("it has no header before its pixels");
        samples.resize(std::size_t{kChannels} * static_cast<std::size_t>(result.picture.width) *
                       static_cast<std::size_t>(result.picture.height));
        const JxlPixelFormat format = format_of(result.samples);
        if (result.samples == Samples::kHalf) floats.resize(samples.size());
        const std::span<std::byte> values = floats.empty()
                                                ? std::as_writable_bytes(std::span(samples))
                                                : std::as_writable_bytes(std::span(floats));
        if (JxlDecoderSetImageOutBuffer(decoder.get(), &format, values.data(), values.size()) !=
            JXL_DEC_SUCCESS) {
          throw std::runtime_error("libjxl does not decode its pixels");
        }
        break;
      }
      case JXL_DEC_FULL_IMAGE: {
        if (samples.empty()) throw std::runtime_error("it has no pixels");
        if (result.samples == Samples::kHalf) {
          std::ranges::transform(floats, samples.begin(), half_from_float);
          return result;
        }
        const auto largest = (std::uint32_t{1} << static_cast<unsigned>(result.bits)) - 1;
        for (std::uint16_t& value : samples) value = rescaled(value, kFullScale, largest);
        return result;
      }
      case JXL_DEC_NEED_MORE_INPUT:
        throw std::runtime_error("it is truncated");
      default:
        throw std::runtime_error("libjxl finds it damaged");
    }
  }
}

}  // namespace raystage::store
