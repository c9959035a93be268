// SPDX-License-Identifier: Apache-2.0
// Decodes whole frames with libjpeg-turbo, and wanted MCUs of baseline frames to linear light:
// entropy decoding and inverse DCT (scan_decoder.h), then upsampling and colour conversion
// (convert_to_linear.h). Other frames are decoded whole, and only wanted pixels are written. The
// cost of a region grows with the MCUs of each segment up to its last wanted MCU.
#include "store/jpeg/decode.h"

#include <cassert>
#include <string>

#include "base/error.h"
#include "store/jpeg/convert_to_linear.h"
#include "store/jpeg/libjpeg.h"
#include "store/jpeg/scan_decoder.h"

namespace raystage::store {

struct JpegDecoder::State {
  ScanDecoder scan;
};

JpegDecoder::JpegDecoder() : state_(std::make_unique<State>()) {}
JpegDecoder::~JpegDecoder() = default;
JpegDecoder::JpegDecoder(JpegDecoder&&) noexcept = default;

RgbImage JpegDecoder::decode(std::span<const std::byte> jpeg, std::string_view name) {
  return decode_scaled(jpeg, 1, name);
}

RgbImage JpegDecoder::decode_scaled(std::span<const std::byte> jpeg, int divisor,
                                    std::string_view name) {
  assert(divisor == 1 || divisor == 2 || divisor == 4 || divisor == 8);
  const JpegLayout layout = parse_jpeg_layout(jpeg, name);  // its errors are more specific
  RgbImage image;
  image.width = (layout.width + divisor - 1) / divisor;
  image.height = (layout.height + divisor - 1) / divisor;
  const std::size_t row_bytes = 3 * static_cast<std::size_t>(image.width);
  image.values.resize(row_bytes * static_cast<std::size_t>(image.height));
  // A new one per frame: libjpeg keeps tables between frames, and a frame without its own would be
  // decoded with those of another one.
  libjpeg::Decompressor decompressor;
  jpeg_decompress_struct& info = decompressor.info;
  libjpeg::ErrorManager& errors = decompressor.errors;
  const bool decoded = libjpeg::guarded(errors, [&] {
    decompressor.set_input(jpeg);
    jpeg_read_header(&info, TRUE);
    info.out_color_space = JCS_RGB;
    info.dct_method = JDCT_ISLOW;
    info.do_fancy_upsampling = TRUE;
    info.scale_num = 1;
    info.scale_denom = static_cast<unsigned>(divisor);
    jpeg_start_decompress(&info);
    while (info.output_scanline < info.output_height) {
      JSAMPROW row = image.values.data() + info.output_scanline * row_bytes;
      jpeg_read_scanlines(&info, &row, 1);
    }
    jpeg_finish_decompress(&info);
  });
  if (!decoded) libjpeg::throw_error(errors, name);
  return image;
}

std::int64_t JpegDecoder::decode_region(std::span<const std::byte> jpeg, const JpegLayout& layout,
                                        const McuMask& wanted, const LinearTable& table,
                                        std::span<std::uint16_t> rgba_linear,
                                        std::string_view name) {
  assert(wanted.size() == static_cast<std::size_t>(layout.mcu_count()));
  assert(rgba_linear.size() ==
         4 * static_cast<std::size_t>(layout.width) * static_cast<std::size_t>(layout.height));
  // The layout of a frame on another host came in a message of its own.
  const auto refuse = [&] {
    return Error::bad_input("the frame is not the one that its layout describes", std::string(name),
                            "Render again");
  };
  if (jpeg.size() < layout.scan_end + 2) throw refuse();
  const auto mcu_pixels = std::int64_t{layout.mcu_width} * layout.mcu_height;
  if (layout.baseline_ycc) {
    const std::int64_t mcus = state_->scan.decode(jpeg, layout, wanted, name);
    convert_to_linear(state_->scan, layout, wanted, table, rgba_linear);
    return mcus * mcu_pixels;
  }
  const RgbImage image = decode(jpeg, name);
  if (image.width != layout.width || image.height != layout.height) throw refuse();
  const auto width = static_cast<std::size_t>(layout.width);
  for (std::size_t pixel = 0; pixel < width * static_cast<std::size_t>(layout.height); ++pixel) {
    const auto x = static_cast<int>(pixel % width), y = static_cast<int>(pixel / width);
    const int mcu = y / layout.mcu_height * layout.mcus_per_row + x / layout.mcu_width;
    if (wanted[mcu] == 0) continue;
    for (std::size_t c = 0; c < 3; ++c)
      rgba_linear[4 * pixel + c] = table.code[c][image.values[3 * pixel + c]];
    rgba_linear[4 * pixel + 3] = 65535;
  }
  return layout.mcu_count() * mcu_pixels;
}

}  // namespace raystage::store
