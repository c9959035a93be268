// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <vector>

#include "ingest/movie_frame.h"

namespace raystage::ingest {

/// What MovieReader does, by FFmpeg, in the decoder's process. On damaged files anything may
/// happen.
class MovieDecoder {
 public:
  /// Throws Error (bad input) if the file is missing, is not a movie, has no video, or has a codec
  /// without decoder.
  explicit MovieDecoder(std::filesystem::path file);
  ~MovieDecoder();
  MovieDecoder(const MovieDecoder&) = delete;
  MovieDecoder& operator=(const MovieDecoder&) = delete;

  MovieFormat format() const;

  /// Reads the next frame; returns false at the end. `is_deep`: into MovieFrame::deep instead of
  /// `image`. Throws Error (bad input) if it is damaged.
  bool next(MovieFrame& frame, bool is_deep);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace raystage::ingest
