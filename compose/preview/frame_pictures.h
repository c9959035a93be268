// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "compose/exr/exr_file.h"
#include "compose/preview/display.h"
#include "compose/preview/stereo_packing.h"
#include "images/exr_reader.h"
#include "store/jpeg/rgb_image.h"

namespace raystage::compose {

/// How the frames of several sequences become one picture.
enum class Arrangement {
  kSideBySide,  ///< from left to right
  kWipe,        ///< the first of two on the left of a line, the second on its right
  kDifference   ///< the absolute difference of two, of the values in the files
};

/// What the pictures of a preview show.
struct FramePictureOptions {
  std::vector<std::string> sequences = {};  ///< SequenceName patterns, at least one
  Arrangement arrangement = Arrangement::kSideBySide;
  double wipe_position = 0.5;  ///< of the line, in picture widths from the left
  StereoPacking stereo = StereoPacking::kNone;
  /// "alpha", "Z", "coverage", "confidence" or the name of a channel in the files; empty: the
  /// picture.
  std::string channel = {};
  /// Values of the channel with the first and the last colour; none: 0 to 1 of alpha, coverage and
  /// confidence, nearly all values of the first frame of others.
  std::optional<std::array<double, 2>> range = {};
  DisplayOptions display = {};
  bool is_valid(std::string* reason) const;
  /// Returns whether depths are shown in false colours.
  bool shows_depth_channel() const;
};

/// Makes the pictures of frames.
class FramePictures {
 public:
  explicit FramePictures(FramePictureOptions options) : options_(std::move(options)) {}

  /// Reads a frame of each sequence, which replaces the previous one. Throws Error (bad input) if a
  /// file is missing or damaged, lacks the channel or a view, or has another size than the others
  /// or the previous frame.
  void read(int frame);

  /// Returns size, rate, time code and projection of the first sequence's frame; pixels of pictures
  /// only. The size is that of the packed views.
  const ExrImage& frame() const { return frames_.front().image; }
  /// Returns the picture of the frames. The first one sets the range of a channel.
  store::RgbImage picture();
  /// Returns the picture with at most `width` pixels for each sequence in it.
  store::RgbImage thumbnail(int width);
  /// Returns the range that is shown, e.g. "Z from 2.1 (red) to 9.3 m"; empty for pictures.
  std::string range_text() const;

 private:
  struct Frame {
    ExrImage image;
    std::vector<float> values;  ///< of the channel; empty for pictures
  };
  Frame read_view(const std::filesystem::path& file, const std::string& view) const;
  Frame read_stereo(const std::filesystem::path& file) const;
  store::RgbImage arrange(const std::vector<Frame>& frames);
  store::RgbImage show(const Frame& frame) const;
  Frame difference(const std::vector<Frame>& frames) const;
  void set_range(const Frame& first);

  FramePictureOptions options_;
  images::ExrReader reader_;
  std::vector<Frame> frames_;
  std::optional<std::array<double, 2>> range_;  ///< of the channel, once it is known
};

}  // namespace raystage::compose
