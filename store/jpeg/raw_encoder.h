// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "store/jpeg/encode.h"
#include "store/jpeg/raw_image.h"

namespace raystage::store {

/// Encodes uncompressed pictures one after another and reuses its state between them. Not
/// thread-safe.
class RawJpegEncoder {
 public:
  explicit RawJpegEncoder(const JpegEncodeOptions& options);
  ~RawJpegEncoder();
  RawJpegEncoder(RawJpegEncoder&&) noexcept;
  RawJpegEncoder& operator=(RawJpegEncoder&&) noexcept;

  /// Encodes a picture into `bytes`, which is overwritten with its capacity kept. YUV planes keep
  /// their chroma sampling, whatever the settings, and are not converted. RGB and BGR get the
  /// sampling of the settings; grey gives one component. Throws Error (bad input) for sizes outside
  /// 1-65500.
  void encode(const RawImage& image, std::vector<std::byte>& bytes);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace raystage::store
