// SPDX-License-Identifier: Apache-2.0
// How the frames of exported image sequences are stored.
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "exports/exr_color_space.h"
#include "exports/frame_choice.h"
#include "exports/source_frames.h"
#include "store/take.h"

namespace raystage::exports {

/// Settings of EXR files.
struct ExrExportOptions {
  std::string compression = "zip";  ///< none | zips | zip
  std::string program_version = {};
  ExrColorSpace color = {};
};

/// Converts the frames of one camera. Not thread-safe.
class ImageEncoder {
 public:
  virtual ~ImageEncoder() = default;
  /// Returns the file of a frame. `source`: has read the frame. Throws Error (bad input) if it is
  /// damaged.
  virtual std::vector<std::byte> encode(const SourceFrames::Ready& ready, SourceFrames& source) = 0;
};

/// A format of image files. To add one: a class in image_formats.cpp and a line in image_formats().
class ImageFormat {
 public:
  virtual ~ImageFormat() = default;
  /// Returns the name by which users choose it.
  virtual std::string_view name() const = 0;
  /// Returns what the help says.
  virtual std::string_view description() const = 0;
  virtual std::string_view extension() const = 0;  ///< ".jpg"
  /// Returns the colour space of the files, as take.json names it.
  virtual std::string color_space(const store::Take& take) const {
    return take.document().color_space;
  }
  /// Returns the bytes that the files need, roughly. `source_bytes`: of the JPEG frames.
  virtual double estimated_bytes(double source_bytes, double pixels) const = 0;
  /// Returns whether the encoder takes the pictures of frames of more than 8 bits (Ready::deep)
  /// instead of JPEGs of them, which are clipped at white.
  virtual bool keeps_deep_pictures() const { return false; }
  /// Returns the encoder of a camera. `fps`: of the sequence. Refers to the take.
  virtual std::unique_ptr<ImageEncoder> open(const store::Take& take, int camera, double fps,
                                             const ExrExportOptions& exr) const = 0;
};

/// Returns all formats; they live until the program ends.
std::span<const ImageFormat* const> image_formats();
/// Returns the format of this name. Throws std::logic_error if there is none.
const ImageFormat& image_format(std::string_view name);

}  // namespace raystage::exports
