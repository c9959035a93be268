// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <vector>

#include "store/jpeg/rgb_image.h"

namespace raystage {

/// One frame of a movie: the JPEG as it stands in the file, or else the decoded picture.
struct MovieFrame {
  std::vector<std::byte> jpeg;  ///< not empty for a stream of Motion JPEG
  RgbImage image;               ///< otherwise
};

/// Reads the frames of a movie's first video stream, in the order they are shown, through FFmpeg.
/// Motion JPEG is handed out byte for byte. Anything else becomes 8-bit RGB by the stream's own
/// matrix and range; where it names no matrix it is BT.601, as FFmpeg's and OpenCV's own tools read
/// it. Only local files are opened. The picture is not turned by display matrices.
class MovieReader {
 public:
  /// Throws Error (bad input): no such file, no movie, no video in it, no decoder.
  explicit MovieReader(std::filesystem::path file);
  ~MovieReader();
  MovieReader(const MovieReader&) = delete;
  MovieReader& operator=(const MovieReader&) = delete;

  /// Reads the next frame; returns false at the end. Throws Error (bad input) for a damaged frame;
  /// no frame is skipped.
  bool next(MovieFrame& frame);
  /// Skips the remaining frames and returns their number.
  int skip_rest();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace raystage
