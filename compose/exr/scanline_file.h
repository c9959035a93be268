// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

// OpenEXR's versioned namespace makes a forward declaration of Imf::Header unportable.
#include <OpenEXR/ImfHeader.h>

namespace raystage::compose {

/// The values of a channel, from the top left of the data window.
struct ScanlineChannel {
  std::string name;
  bool is_half = false;          ///< stored as half: clamped, NaN becomes 0; else as float
  const float* first = nullptr;  ///< value of the first pixel
  std::size_t stride = 1;        ///< values from pixel to pixel, lines without gaps
  float nan_replacement = 0;     ///< of floats
};

/// A part of a file. The header has all attributes but the list of channels.
struct ScanlinePart {
  Imf::Header header;
  std::vector<ScanlineChannel> channels;
};

/// Returns whether write_scanline_file() has this compression.
bool is_scanline_file_compression(Imf::Compression compression);

/// Returns the bytes of a scan line file of one or more parts (OpenEXR file layout), compressed
/// with none, zips or zip. Chunks are compressed in parallel by libdeflate, which takes a third of
/// zlib's time. Deterministic. Throws as Imf::Header::sanityCheck() for headers that are no valid
/// file, and std::bad_alloc.
std::vector<std::byte> write_scanline_file(std::span<const ScanlinePart> parts);

}  // namespace raystage::compose
