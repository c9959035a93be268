// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

#include "store/jpeg/rgb_image.h"

namespace raystage::test_images {

/// What cameras and programs may write that encode_jpeg does not.
struct OddJpeg {
  int quality = 90;
  bool grey = false;
  bool rgb = false;  ///< components R, G, B with Adobe's marker, no YCbCr
  bool cmyk = false;
  bool progressive = false;
  bool arithmetic = false;
  bool interleaved = true;  ///< all components in one scan
  bool optimised = false;   ///< Huffman tables of its own
  int h[3] = {1, 1, 1}, v[3] = {1, 1, 1};
  int restart_interval = 0;  ///< MCUs
  bool markers = false;      ///< an APP1 and a COM marker
};

std::vector<std::byte> encode_odd(const RgbImage& image, const OddJpeg& what);

/// Without its DHT markers, as many webcams send frames.
std::vector<std::byte> without_huffman_tables(const std::vector<std::byte>& jpeg);

}  // namespace raystage::test_images
