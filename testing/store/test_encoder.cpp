// SPDX-License-Identifier: Apache-2.0
#include "testing/store/test_encoder.h"

#include <stdexcept>

#include "store/jpeg/libjpeg.h"
#include "store/jpeg/markers.h"

namespace raystage::testing {
namespace {

void set_up(jpeg_compress_struct& info, const store::RgbImage& image, const JpegVariant& what) {
  info.image_width = static_cast<JDIMENSION>(image.width);
  info.image_height = static_cast<JDIMENSION>(image.height);
  info.input_components = what.cmyk ? 4 : 3;
  info.in_color_space = what.cmyk ? JCS_CMYK : JCS_RGB;
  jpeg_set_defaults(&info);
  if (what.grey) jpeg_set_colorspace(&info, JCS_GRAYSCALE);
  if (what.rgb) jpeg_set_colorspace(&info, JCS_RGB);
  jpeg_set_quality(&info, what.quality, TRUE);
  for (int c = 0; c < 3 && c < info.num_components; ++c) {
    info.comp_info[c].h_samp_factor = what.h[c];
    info.comp_info[c].v_samp_factor = what.v[c];
  }
  info.arith_code = what.arithmetic;
  info.optimize_coding = what.optimised;
  info.restart_interval = static_cast<unsigned>(what.restart_interval);
  if (what.progressive) jpeg_simple_progression(&info);
}

}  // namespace

std::vector<std::byte> encode_jpeg_variant(const store::RgbImage& image, const JpegVariant& what) {
  std::vector<std::byte> bytes;
  std::vector<JSAMPLE> four(4 * static_cast<std::size_t>(image.width), 100);
  jpeg_scan_info scans[3] = {};
  for (int c = 0; c < 3; ++c) scans[c] = {1, {c, 0, 0, 0}, 0, 63, 0, 0};
  store::libjpeg::Compressor compressor;
  jpeg_compress_struct& info = compressor.info;
  store::libjpeg::VectorDestination destination(info, bytes);
  const std::size_t row_bytes = 3 * static_cast<std::size_t>(image.width);
  const bool encoded = store::libjpeg::guarded(compressor.errors, [&] {
    set_up(info, image, what);
    if (!what.interleaved) {
      info.scan_info = scans;
      info.num_scans = 3;
    }
    jpeg_start_compress(&info, TRUE);
    if (what.markers) {
      const JOCTET text[] = {'E', 'x', 'i', 'f', 0, 0, 7};
      jpeg_write_marker(&info, JPEG_APP0 + 1, text, sizeof(text));
      jpeg_write_marker(&info, JPEG_COM, text, 3);
    }
    while (info.next_scanline < info.image_height) {
      JSAMPROW row =
          what.cmyk ? four.data()
                    : const_cast<JSAMPROW>(image.values.data() + info.next_scanline * row_bytes);
      jpeg_write_scanlines(&info, &row, 1);
    }
    jpeg_finish_compress(&info);
  });
  if (!encoded) throw std::runtime_error(compressor.errors.text);
  bytes.resize(destination.file().size());
  return bytes;
}

std::vector<std::byte> without_huffman_tables(const std::vector<std::byte>& jpeg) {
  store::MarkerReader markers(jpeg, "test");
  markers.read_soi();
  std::vector<std::byte> bytes(jpeg.begin(), jpeg.begin() + 2);
  for (;;) {
    const store::Marker marker = markers.next();
    const auto from = jpeg.begin() + static_cast<std::ptrdiff_t>(marker.offset);
    const auto to = jpeg.begin() + static_cast<std::ptrdiff_t>(marker.end);
    if (marker.code != store::kMarkerDht) bytes.insert(bytes.end(), from, to);
    if (marker.code != store::kMarkerSos) continue;
    bytes.insert(bytes.end(), to, jpeg.end());
    return bytes;
  }
}

}  // namespace raystage::testing
