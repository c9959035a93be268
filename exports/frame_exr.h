// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <string_view>
#include <vector>

#include "compose/exr/exr_header.h"
#include "exports/image_format.h"
#include "store/processing/frames/photometric_correction.h"
#include "store/take.h"

namespace raystage::exports {

/// Writes frames of a camera as EXR: scene-linear Rec.709, or the linear space of the options,
/// after the camera's photometric correction, as the renderer sees them, half R, G, B. The header
/// has time, pose and lens (docs/formats/exr.md).
class FrameExrEncoder : public ImageEncoder {
 public:
  FrameExrEncoder(const store::Take& take, int camera, double fps, ExrExportOptions options);
  std::vector<std::byte> encode(const SourceFrames::Ready& ready, SourceFrames& source) override;

 private:
  Imf::Header header_of(const ChosenFrame& frame) const;
  std::vector<float> pixels_of(const SourceFrames::Ready& ready);
  /// The same of a frame of more than 8 bits.
  std::vector<float> deep_pixels_of(const store::DeepPicture& picture) const;

  const store::Take& take_;
  int camera_;
  ExrExportOptions options_;
  compose::ExrMetadata metadata_;
  compose::ExrCamera view_;
  store::CodeScale scale_;
  store::PhotometricCorrection correction_;
  std::vector<float> light_;  ///< of each level
  /// Light of each sample of more than 8 bits, R, G, B one after the other, if nothing else than a
  /// table is needed: exact, unlike levels. Empty: levels are used.
  std::vector<float> light_of_sample_;
  store::JpegDecoder decoder_;
};

}  // namespace raystage::exports
