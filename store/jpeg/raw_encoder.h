// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "store/jpeg/encode.h"
#include "store/jpeg/raw_image.h"

namespace raystage {

/// Encodes one uncompressed picture after another; keeps what can be kept between them. One thread
/// at a time.
class RawJpegEncoder {
 public:
  explicit RawJpegEncoder(const JpegEncodeSettings& settings);
  ~RawJpegEncoder();
  RawJpegEncoder(RawJpegEncoder&&) noexcept;
  RawJpegEncoder& operator=(RawJpegEncoder&&) noexcept;

  /// YUV planes keep their chroma sampling, whatever the settings say, and are not converted; RGB
  /// and BGR get the settings' sampling; grey gives a JPEG of one component. `bytes` is filled
  /// anew, with its room kept. Throws Error (bad input) for sizes outside 1-65500.
  void encode(const RawImage& image, std::vector<std::byte>& bytes);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace raystage
