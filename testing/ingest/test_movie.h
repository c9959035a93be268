// SPDX-License-Identifier: Apache-2.0
#pragma once

extern "C" {
#include <libavutil/pixfmt.h>
}

#include <array>
#include <filesystem>

namespace raystage::testing {

/// A movie of one colour with lossless compression (FFV1, 4:4:4) in Matroska, or
/// in QuickTime if the file is named .mov: its index is at the end.
struct MovieDescription {
  int width = 0, height = 0;  ///< pixels
  int frames = 1;
  std::array<int, 3> yuv{120, 128, 128};  ///< codes of every pixel
  AVColorSpace matrix = AVCOL_SPC_UNSPECIFIED;
  AVColorRange range = AVCOL_RANGE_MPEG;
};

/// Writes the movie. Throws std::runtime_error if FFmpeg fails.
void write_movie(const std::filesystem::path& file, const MovieDescription& movie);

}  // namespace raystage::testing
