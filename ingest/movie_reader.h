// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <vector>

#include "store/jpeg/rgb_image.h"

namespace raystage::ingest {

/// One frame of a movie: its JPEG bytes as stored in the file, or else the decoded image.
struct MovieFrame {
  std::vector<std::byte> jpeg;  ///< not empty if the stream is Motion JPEG
  store::RgbImage image;        ///< otherwise
};

/// Reads the frames of a movie's best video stream through FFmpeg, in presentation order. Motion
/// JPEG is returned byte for byte. Other codecs are decoded to 8-bit RGB with the stream's colour
/// matrix and range; without a matrix BT.601 is assumed, as FFmpeg's and OpenCV's own tools do.
/// Opens local files only. Display matrices (rotation) are ignored.
class MovieReader {
 public:
  /// Throws Error (bad input) if the file is missing, is not a movie, has no video, or has a codec
  /// without decoder.
  explicit MovieReader(std::filesystem::path file);
  ~MovieReader();
  MovieReader(const MovieReader&) = delete;
  MovieReader& operator=(const MovieReader&) = delete;

  /// Reads the next frame; returns false at the end. Throws Error (bad input) if it is damaged.
  bool next(MovieFrame& frame);
  /// Skips the remaining frames and returns their number.
  int skip_rest();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace raystage::ingest
