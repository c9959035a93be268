// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

#include "store/jpeg/rgb_image.h"

namespace raystage::testing {

/// Variants of JPEG that cameras and programs write and encode_jpeg does not.
struct JpegVariant {
  int quality = 90;
  bool grey = false;
  bool rgb = false;  ///< components R, G, B with Adobe's marker, no YCbCr
  bool cmyk = false;
  bool progressive = false;
  bool arithmetic = false;
  bool interleaved = true;  ///< all components in one scan
  bool optimised = false;   ///< optimised Huffman tables
  int h[3] = {1, 1, 1}, v[3] = {1, 1, 1};
  int restart_interval = 0;  ///< MCUs
  bool markers = false;      ///< an APP1 and a COM marker
};

std::vector<std::byte> encode_jpeg_variant(const store::RgbImage& image, const JpegVariant& what);

/// Returns the JPEG without its DHT markers, as many webcams send frames.
std::vector<std::byte> without_huffman_tables(const std::vector<std::byte>& jpeg);

}  // namespace raystage::testing
