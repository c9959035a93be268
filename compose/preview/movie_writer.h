// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "store/jpeg/rgb_image.h"

namespace raystage {

/// Writes a movie for the screen: H.264 where libavcodec has libx264, otherwise MPEG-4 part 2;
/// 4:2:0, tagged Rec.709, limited range. Under a temporary name until close().
class MovieWriter {
 public:
  struct Settings {
    int width = 0, height = 0;  ///< pixels; an odd size repeats its last column or row
    int fps_numerator = 24, fps_denominator = 1;
  };
  /// The container follows the extension (.mp4, .mov, .mkv). Throws Error: bad input for an unknown
  /// extension, failed for an encoder or a file that cannot be opened.
  MovieWriter(const std::filesystem::path& file, const Settings& settings);
  ~MovieWriter();  ///< removes what was not closed
  MovieWriter(const MovieWriter&) = delete;
  MovieWriter& operator=(const MovieWriter&) = delete;

  /// sRGB codes of the size given above.
  void append(const RgbImage& picture);
  void close();
  /// "libx264" or "mpeg4".
  std::string encoder() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace raystage
