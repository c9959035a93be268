// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "compose/preview/stereo_packing.h"
#include "store/jpeg/rgb_image.h"

namespace raystage::compose {

/// Writes a preview movie: H.264 if libavcodec has libx264, otherwise MPEG-4 part 2; 4:2:0, tagged
/// Rec.709, limited range. The file has a temporary name until close().
class MovieWriter {
 public:
  struct Options {
    int width = 0, height = 0;  ///< pixels; an odd size repeats its last column or row
    int fps_numerator = 24, fps_denominator = 1;
    /// Stated in .mp4 and .mkv files, so that players show all directions or both eyes.
    bool is_equirectangular = false;
    StereoPacking stereo = StereoPacking::kNone;
  };
  /// Opens the file and the encoder. The extension selects the container (.mp4, .mov, .mkv). Throws
  /// Error: bad input for an unknown extension, and for .mov if the pictures are stereo;
  /// failed if the encoder or the file cannot be opened.
  MovieWriter(const std::filesystem::path& file, const Options& options);
  ~MovieWriter();  ///< removes the file unless it was closed
  MovieWriter(const MovieWriter&) = delete;
  MovieWriter& operator=(const MovieWriter&) = delete;

  /// Appends a picture of sRGB codes. Its size is that of the settings.
  void append(const store::RgbImage& picture);
  void close();
  /// Returns "libx264" or "mpeg4".
  std::string encoder() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace raystage::compose
