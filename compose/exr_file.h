// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "compose/exr_header.h"
#include "render/view/view.h"

namespace raystage {

/// The bytes of a scanline EXR file: half R, G, B, A, float Z and lf.coverage, on request
/// lf.cameras and lf.nearest (a view that does not know them had none). Colours that half cannot
/// hold are cut to +-65504; a NaN becomes 0 (Z: +infinity). Deterministic.
std::vector<std::byte> encode_exr(const RenderedView& view, const ExrMetadata& metadata);

/// encode_exr() to a file, under a temporary name and renamed. Returns the bytes written. Throws
/// Error (failed) for the disk.
std::size_t write_exr(const RenderedView& view, const ExrMetadata& metadata,
                      const std::filesystem::path& file);

/// Whether the file is an EXR with every pixel present and `fingerprint` in its header. Pixels are
/// read but not decompressed. False, not an error, for whatever is wrong with the file.
bool exr_is_whole(const std::filesystem::path& file, std::string_view fingerprint);

/// What a preview needs of an EXR file.
struct ExrImage {
  int width = 0, height = 0;  ///< of the display window
  std::vector<float> rgba;    ///< premultiplied; where the data window ends, 0
  int fps_numerator = 24, fps_denominator = 1;
};

/// Reads R, G, B and A (1 where there is none) of any flat EXR within its display window. Throws
/// Error (bad input) where it is missing, damaged or no EXR.
ExrImage read_exr(const std::filesystem::path& file);

}  // namespace raystage
