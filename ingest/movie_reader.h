// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <vector>

#include "ingest/movie_frame.h"
#include "sandbox/decoder_process.h"

namespace raystage::ingest {

/// Reads the frames of a movie's best video stream through FFmpeg in presentation order. Motion
/// JPEG is returned byte for byte. Other codecs are decoded to RGB of 8 or 16 bits with the
/// stream's colour matrix and range; without a matrix BT.601 is assumed, as FFmpeg's and OpenCV's
/// own tools do. Opens this file only, in a confined process. Display matrices (rotation) are
/// ignored.
class MovieReader {
 public:
  /// Throws Error (bad input) if the file is missing, is not a movie, has no video, or has a codec
  /// without decoder; Error (failed) as sandbox::DecoderProcess does.
  explicit MovieReader(std::filesystem::path file);

  /// Returns the frames per second that the file states; 0 if it states none.
  double frame_rate() const { return format_.frame_rate; }
  const MovieFormat& format() const { return format_; }

  /// Reads the next frame; returns false at the end. `is_deep`: into MovieFrame::deep with 16 bits
  /// instead of `image`. Throws Error (bad input) if it is damaged.
  bool next(MovieFrame& frame, bool is_deep = false);
  /// Skips the remaining frames and returns their number.
  int skip_rest();

 private:
  std::filesystem::path file_;
  sandbox::DecoderProcess decoder_;
  MovieFormat format_;

  std::vector<std::byte> ask(MovieRequest request);
};

}  // namespace raystage::ingest
