// SPDX-License-Identifier: Apache-2.0
// Internal to ingest/sources.
#pragma once

#include <memory>

#include "ingest/sources/ffmpeg_pointers.h"

namespace raystage::ingest {

/// Converts pictures of any FFmpeg pixel format to a PixelFormat, full range and Rec.601. Pictures
/// that have such a format are passed on without a copy. Otherwise swscale converts: YUV stays YUV
/// of the nearest subsampling, grey stays grey, all else (RGB, Bayer patterns, palettes) becomes
/// RGB. Each source needs its own converter, which keeps swscale's state.
///
/// As in FFmpeg's own tools, YUV without a range is taken as limited, grey as full, and YUV without
/// a matrix as Rec.601. Chroma siting (left, centre) is not corrected.
class PixelConverter {
 public:
  /// Returns false, with an empty `image`, if swscale cannot convert. `picture` need not be
  /// reference-counted: `owner` keeps its pixels alive.
  bool convert(const AVFrame& picture, std::shared_ptr<const void> owner, store::RawImage& image);
  /// Converts to `format`, always into new memory.
  bool convert_to(store::PixelFormat format, const AVFrame& picture, store::RawImage& image);

 private:
  struct Kind {
    int width = 0, height = 0, format = AV_PIX_FMT_NONE, target = AV_PIX_FMT_NONE, matrix = 0;
    bool full_range = false;
    bool operator==(const Kind&) const = default;
  };
  bool prepare(const Kind& kind);

  Kind kind_;
  AvPtr<SwsContext> scaler_;
};

}  // namespace raystage::ingest
