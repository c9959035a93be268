// SPDX-License-Identifier: Apache-2.0
// Lossless recompression of JPEG by libjxl (ISO/IEC 18181-1, annex on JPEG reconstruction): the
// quantised coefficients are entropy-coded again with better context models; a "jbrd" box holds
// what else the file consists of. Input and output: bytes in memory. One thread. libjxl 0.7 takes
// nearly all of its memory past the memory manager that it is given, so that only the limits of the
// process (sandbox/) hold.
#include "store/jpegxl/transcoding.h"

#include <jxl/decode.h>
#include <jxl/encode.h>

#include <algorithm>
#include <memory>
#include <new>
#include <stdexcept>
#include <string>

namespace raystage::store {
namespace {

const auto* unsigned_bytes(std::span<const std::byte> bytes) {
  return reinterpret_cast<const std::uint8_t*>(bytes.data());
}

/// Throws unless the picture of a codestream, whose header the decoder has read, is small enough.
void check_size(const JxlDecoder* decoder, std::uint64_t pixels) {
  JxlBasicInfo info{};
  if (JxlDecoderGetBasicInfo(decoder, &info) != JXL_DEC_SUCCESS)
    throw std::runtime_error("it has no header");
  if (info.xsize == 0 || info.ysize == 0 || info.xsize > pixels / info.ysize) {
    throw std::runtime_error("it states " + std::to_string(info.xsize) + " x " +
                             std::to_string(info.ysize) +
                             " pixels, which is more than its camera has");
  }
}

struct DestroyDecoder {
  void operator()(JxlDecoder* decoder) const { JxlDecoderDestroy(decoder); }
};
struct DestroyEncoder {
  void operator()(JxlEncoder* encoder) const { JxlEncoderDestroy(encoder); }
};

}  // namespace

std::vector<std::byte> transcode_jpeg(std::span<const std::byte> jpeg, int effort) {
  const std::unique_ptr<JxlEncoder, DestroyEncoder> encoder(JxlEncoderCreate(nullptr));
  if (!encoder) throw std::bad_alloc();
  const auto require = [&](JxlEncoderStatus status, const char* what) {
    if (status != JXL_ENC_SUCCESS) throw std::runtime_error(what);
  };
  require(JxlEncoderUseContainer(encoder.get(), JXL_TRUE), "libjxl writes no container");
  require(JxlEncoderStoreJPEGMetadata(encoder.get(), JXL_TRUE), "libjxl stores no JPEG metadata");
  JxlEncoderFrameSettings* const settings =
      JxlEncoderFrameSettingsCreate(encoder.get(), nullptr);  // the encoder owns it
  if (settings == nullptr) throw std::bad_alloc();
  require(JxlEncoderFrameSettingsSetOption(settings, JXL_ENC_FRAME_SETTING_EFFORT, effort),
          "libjxl does not know this effort");
  require(JxlEncoderAddJPEGFrame(settings, unsigned_bytes(jpeg), jpeg.size()),
          "libjxl does not accept the JPEG");
  JxlEncoderCloseInput(encoder.get());
  std::vector<std::byte> container(jpeg.size() / 8 * 7 + 4096);
  std::size_t used = 0;
  for (;;) {
    auto* next = reinterpret_cast<std::uint8_t*>(container.data()) + used;
    std::size_t space = container.size() - used;
    const JxlEncoderStatus status = JxlEncoderProcessOutput(encoder.get(), &next, &space);
    used = container.size() - space;
    if (status == JXL_ENC_SUCCESS) break;
    if (status != JXL_ENC_NEED_MORE_OUTPUT)
      throw std::runtime_error("libjxl cannot encode the JPEG");
    // A frame that does not become smaller stays as it is.
    if (container.size() > jpeg.size() + 4096) throw std::runtime_error("it does not get smaller");
    container.resize(container.size() * 2);
  }
  container.resize(used);
  return container;
}

std::vector<std::byte> reconstruct_jpeg(std::span<const std::byte> container, std::size_t size,
                                        std::uint64_t max_pixels) {
  const std::unique_ptr<JxlDecoder, DestroyDecoder> decoder(JxlDecoderCreate(nullptr));
  if (!decoder) throw std::bad_alloc();
  constexpr int kEvents = JXL_DEC_BASIC_INFO | JXL_DEC_JPEG_RECONSTRUCTION | JXL_DEC_FULL_IMAGE;
  if (JxlDecoderSubscribeEvents(decoder.get(), kEvents) != JXL_DEC_SUCCESS ||
      JxlDecoderSetInput(decoder.get(), unsigned_bytes(container), container.size()) !=
          JXL_DEC_SUCCESS) {
    throw std::runtime_error("libjxl does not read it");
  }
  JxlDecoderCloseInput(decoder.get());
  std::vector<std::byte> jpeg;
  bool has_buffer = false, has_header = false;
  for (;;) {
    switch (JxlDecoderProcessInput(decoder.get())) {
      case JXL_DEC_BASIC_INFO:
        check_size(decoder.get(), max_pixels);
        has_header = true;
        break;
      case JXL_DEC_JPEG_RECONSTRUCTION:
        if (!has_header) throw std::runtime_error("it has no header before its JPEG");
        jpeg.resize(size);
        if (JxlDecoderSetJPEGBuffer(decoder.get(), reinterpret_cast<std::uint8_t*>(jpeg.data()),
                                    jpeg.size()) != JXL_DEC_SUCCESS) {
          throw std::runtime_error("libjxl does not reconstruct its JPEG");
        }
        has_buffer = true;
        break;
      case JXL_DEC_FULL_IMAGE:
        if (!has_buffer) throw std::runtime_error("it was not made from a JPEG");
        if (JxlDecoderReleaseJPEGBuffer(decoder.get()) != 0) {
          throw std::runtime_error("its JPEG is smaller than stated");
        }
        return jpeg;
      case JXL_DEC_JPEG_NEED_MORE_OUTPUT:
        throw std::runtime_error("its JPEG is larger than stated");
      case JXL_DEC_NEED_IMAGE_OUT_BUFFER:  // of a codestream without a JPEG
        throw std::runtime_error("it was not made from a JPEG");
      case JXL_DEC_NEED_MORE_INPUT:
        throw std::runtime_error("it is truncated");
      default:
        throw std::runtime_error("libjxl finds it damaged");
    }
  }
}

}  // namespace raystage::store
