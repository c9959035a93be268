// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "store/jpeg/rgb_image.h"

namespace raystage::ingest {

/// One frame of a movie: its JPEG bytes as stored in the file, or else the decoded image.
struct MovieFrame {
  std::vector<std::byte> jpeg;  ///< not empty if the stream is Motion JPEG
  store::RgbImage image;        ///< otherwise
};

/// What raystage-decode-movie is asked for.
enum class MovieRequest : std::uint8_t {
  kOpen,  ///< the file's name follows; result: frames per second or 0, double
  kNext   ///< result: MovieFrameKind, then bytes, or width, height and values
};

enum class MovieFrameKind : std::uint8_t { kNone, kJpeg, kImage };

}  // namespace raystage::ingest
