// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "compose/exr/exr_header.h"
#include "compose/exr/exr_layout.h"

namespace raystage {

/// The bytes of a scanline EXR file. `views`: at least one, with the same layers; `cameras`: of
/// each of them, of one size. Colours are half: what that cannot hold is cut to +-65504, a NaN
/// becomes 0; data are float. Deterministic.
std::vector<std::byte> encode_exr(std::span<const ExrView> views,
                                  std::span<const ExrCamera> cameras, const ExrMetadata& metadata);

/// encode_exr() to a file, under a temporary name and renamed. Returns the bytes written. Throws
/// Error (failed) for the disk.
std::size_t write_exr(std::span<const ExrView> views, std::span<const ExrCamera> cameras,
                      const ExrMetadata& metadata, const std::filesystem::path& file);

/// Whether the file is an EXR with every pixel of every part present and `fingerprint` in their
/// headers. Pixels are
/// read but not decompressed. False, not an error, for whatever is wrong with the file.
bool is_complete_exr(const std::filesystem::path& file, std::string_view fingerprint);

/// What a preview needs of an EXR file.
struct ExrImage {
  int width = 0, height = 0;  ///< of the display window
  std::vector<float> rgba;    ///< premultiplied; where the data window ends, 0
  int fps_numerator = 24, fps_denominator = 1;
  std::string time_code = {};  ///< "HH:MM:SS:FF"; empty where the file says none
  std::string color_interop_id = {}, color_space = {};  ///< see ExrChannelData
};

/// Reads R, G, B and A (1 where there is none) of the first part of any flat EXR within its display
/// window. Throws Error (bad input) where it is missing, damaged or no EXR.
ExrImage read_exr(const std::filesystem::path& file);

}  // namespace raystage
