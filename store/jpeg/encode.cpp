// SPDX-License-Identifier: Apache-2.0
// Encodes 8-bit RGB pictures by libjpeg-turbo (accurate integer DCT), and adds restart markers to
// existing files. The latter rewrites the entropy-coded data from the unchanged quantised
// coefficients (as jpegtran does), so pixels do not change. Cost: one encode per picture; for
// restart markers one entropy decode and one entropy encode, without DCT.
#include "store/jpeg/encode.h"

#include <algorithm>
#include <string>

#include "base/error.h"
#include "base/options.h"
#include "store/jpeg/layout.h"
#include "store/jpeg/libjpeg.h"

namespace raystage::store {
namespace {

void check_restart_interval(int interval) {
  if (interval < -1 || interval > 65535)
    throw Error::bad_input(
        "a restart interval of " + std::to_string(interval) + " MCUs is not possible", "",
        "Use 1-65535, 0 for none or -1 for the default");
}

void check(const RgbImage& image, const JpegEncodeOptions& options) {
  if (image.width < 1 || image.height < 1 || image.width > 65500 || image.height > 65500)
    throw Error::bad_input("a JPEG cannot have a size of " + std::to_string(image.width) + "x" +
                               std::to_string(image.height),
                           "", "Use 1-65500 pixels per side");
  if (image.values.size() !=
      3 * static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height))
    throw Error::bad_input("the image has too few or too many bytes for its size", "",
                           "Use 3 bytes per pixel");
  require_valid(options, "JPEG options");
}

// Writes the saved APPn and COM markers unchanged (JFIF and Adobe included).
void copy_markers(jpeg_decompress_struct& source, jpeg_compress_struct& target) {
  for (jpeg_saved_marker_ptr marker = source.marker_list; marker != nullptr; marker = marker->next)
    jpeg_write_marker(&target, marker->marker, marker->data, marker->data_length);
}

}  // namespace

int default_restart_interval(int frame_width, int mcu_width) {
  return std::max(1, (frame_width < 640 ? 16 : 32) / mcu_width);
}

bool JpegEncodeOptions::is_valid(std::string* reason) const {
  return is_within("JPEG quality", quality, 1, 100, reason) &&
         is_within("restart interval (MCUs)", restart_interval, -1, 65535, reason);
}

std::vector<std::byte> encode_jpeg(const RgbImage& image, const JpegEncodeOptions& options) {
  check(image, options);
  std::vector<std::byte> bytes;
  libjpeg::Compressor compressor;
  jpeg_compress_struct& info = compressor.info;
  libjpeg::VectorDestination destination(info, bytes);
  const std::size_t row_bytes = 3 * static_cast<std::size_t>(image.width);
  const bool encoded = libjpeg::guarded(compressor.errors, [&] {
    info.image_width = static_cast<JDIMENSION>(image.width);
    info.image_height = static_cast<JDIMENSION>(image.height);
    info.input_components = 3;
    info.in_color_space = JCS_RGB;
    jpeg_set_defaults(&info);
    jpeg_set_quality(&info, options.quality, TRUE);
    info.dct_method = JDCT_ISLOW;
    info.comp_info[0].h_samp_factor = options.chroma == JpegEncodeOptions::Chroma::k444 ? 1 : 2;
    info.comp_info[0].v_samp_factor = options.chroma == JpegEncodeOptions::Chroma::k420 ? 2 : 1;
    info.restart_interval = static_cast<unsigned>(
        options.restart_interval >= 0
            ? options.restart_interval
            : default_restart_interval(image.width, 8 * info.comp_info[0].h_samp_factor));
    if (options.progressive) jpeg_simple_progression(&info);
    jpeg_start_compress(&info, TRUE);
    while (info.next_scanline < info.image_height) {
      // libjpeg only reads through this non-const pointer.
      JSAMPROW row = const_cast<JSAMPROW>(image.values.data() + info.next_scanline * row_bytes);
      jpeg_write_scanlines(&info, &row, 1);
    }
    jpeg_finish_compress(&info);
  });
  if (!encoded) libjpeg::throw_error(compressor.errors, "JPEG encoder");
  bytes.resize(destination.file().size());
  return bytes;
}

std::vector<std::byte> add_restart_markers(std::span<const std::byte> jpeg, int restart_interval,
                                           std::string_view name) {
  check_restart_interval(restart_interval);
  const JpegLayout layout = parse_jpeg_layout(jpeg, name);
  if (restart_interval < 0)
    restart_interval = default_restart_interval(layout.width, layout.mcu_width);
  std::vector<std::byte> bytes;
  libjpeg::Decompressor source;
  libjpeg::Compressor target;
  libjpeg::VectorDestination destination(target.info, bytes);
  jvirt_barray_ptr* coefficients = nullptr;
  const bool read = libjpeg::guarded(source.errors, [&] {
    source.set_input(jpeg);
    jpeg_save_markers(&source.info, JPEG_COM, 0xFFFF);
    for (int n = 0; n < 16; ++n) jpeg_save_markers(&source.info, JPEG_APP0 + n, 0xFFFF);
    jpeg_read_header(&source.info, TRUE);
    coefficients = jpeg_read_coefficients(&source.info);
  });
  if (!read) libjpeg::throw_error(source.errors, name);
  const bool written = libjpeg::guarded(target.errors, [&] {
    jpeg_copy_critical_parameters(&source.info, &target.info);
    target.info.write_JFIF_header = FALSE;
    target.info.write_Adobe_marker = FALSE;
    target.info.optimize_coding = TRUE;
    target.info.restart_interval = static_cast<unsigned>(restart_interval);
    jpeg_write_coefficients(&target.info, coefficients);
    copy_markers(source.info, target.info);
    jpeg_finish_compress(&target.info);
  });
  if (!written) libjpeg::throw_error(target.errors, name);
  const bool finished =
      libjpeg::guarded(source.errors, [&] { jpeg_finish_decompress(&source.info); });
  if (!finished) libjpeg::throw_error(source.errors, name);
  bytes.resize(destination.file().size());
  return bytes;
}

}  // namespace raystage::store
