// SPDX-License-Identifier: Apache-2.0
// Encoding and muxing by FFmpeg.
#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <span>
#include <vector>

#include "base/time.h"
#include "exports/movie_codec.h"
#include "store/jpeg/rgb_image.h"

namespace raystage::exports {

/// An encoder whose pictures all stand alone: a picture in, a packet out.
enum class IntraCodec {
  kProRes,  ///< ProRes 422 HQ: 10 bits, 4:2:2, Rec.709 matrix, limited range
  kFfv1     ///< FFV1 version 3, 8-bit RGB, a CRC per slice: lossless
};

/// Encodes pictures of one size by libavcodec. Same bytes for the same pictures.
class PictureEncoder {
 public:
  /// Throws Error (failed) if libavcodec lacks the encoder; `name`: of the file, for errors.
  PictureEncoder(IntraCodec codec, int width, int height, std::string name);
  ~PictureEncoder();
  PictureEncoder(const PictureEncoder&) = delete;
  PictureEncoder& operator=(const PictureEncoder&) = delete;

  /// Returns the packet of a picture. Throws Error (failed) if it cannot be encoded.
  std::vector<std::byte> encode(const store::RgbImage& picture);
  /// Returns the data that a decoder needs in addition (FFV1's configuration record).
  std::vector<std::byte> extra_data() const;

 private:
  friend class MovMuxer;
  struct State;
  std::unique_ptr<State> state_;
};

/// Writes a QuickTime movie (.mov) with one video track by libavformat. Times are rounded to 1 us,
/// or exact multiples of the frame time if the description has a rate. A frame lasts until the next
/// one. A movie whose first frame is not at 0 begins with an empty edit. The file has a temporary
/// name until close().
class MovMuxer {
 public:
  /// `encoder`: of the packets; null: they are JPEG frames. Throws Error (failed) if the file
  /// cannot be created.
  MovMuxer(const std::filesystem::path& file, const MovieDescription& description,
           const PictureEncoder* encoder);
  ~MovMuxer();
  MovMuxer(const MovMuxer&) = delete;
  MovMuxer& operator=(const MovMuxer&) = delete;

  /// Throws Error (bad input) if times do not increase in the container's unit, Error (failed) if
  /// the disk fails.
  void append(std::span<const std::byte> packet, Nanoseconds time);
  void close();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace raystage::exports
