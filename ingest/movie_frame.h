// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "schemas/pixel_encoding.h"
#include "store/jpeg/rgb_image.h"
#include "store/jpegxl/deep_picture.h"

namespace raystage::ingest {

/// One frame of a movie: its JPEG bytes as stored in the file, or else the decoded image.
struct MovieFrame {
  std::vector<std::byte> jpeg;  ///< not empty if the stream is Motion JPEG
  store::RgbImage image;        ///< otherwise ...
  store::DeepPicture deep;      ///< ... or this, R, G, B of 16 bits, if depth is kept
};

/// What a movie states of its pictures.
struct MovieFormat {
  double frame_rate = 0;  ///< frames per second; 0: it states none
  int bits = 8;           ///< of a component; 8 of Motion JPEG
  schemas::PixelEncoding::Transfer transfer = schemas::PixelEncoding::Transfer::kSrgb;
  bool has_bt2020_primaries = false;  ///< false: Rec.709
};

/// What raystage-decode-movie is asked for.
enum class MovieRequest : std::uint8_t {
  kOpen,      ///< the file's name follows; result: MovieFormat
  kNext,      ///< result: MovieFrameKind, then bytes, or width, height and values
  kNextDeep,  ///< as kNext, but kDeep instead of kImage
};

enum class MovieFrameKind : std::uint8_t { kNone, kJpeg, kImage, kDeep };

}  // namespace raystage::ingest
