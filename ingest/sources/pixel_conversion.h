// SPDX-License-Identifier: Apache-2.0
// Inside ingest/sources only.
#pragma once

#include <memory>

#include "ingest/sources/ffmpeg_pointers.h"
#include "ingest/sources/frame_source.h"

namespace raystage {

/// Turns pictures of any of FFmpeg's pixel formats into one of ours, full range and Rec.601. What
/// is one of ours already is handed on without copying; otherwise swscale converts: YUV stays YUV
/// of the nearest subsampling, grey stays grey, all else (RGB, Bayer patterns, palettes) becomes
/// RGB. One per source: keeps swscale's state.
///
/// As FFmpeg's own tools do, YUV that names no range is taken as limited, grey as full, and YUV
/// that names no matrix as Rec.601. Where chroma was sampled (left, centre) is not corrected.
class PixelConverter {
 public:
  /// `picture` need not be reference-counted; `owner` keeps its pixels alive. False where swscale
  /// cannot convert; `image` is then empty.
  bool convert(const AVFrame& picture, std::shared_ptr<const void> owner, RawImage& image);
  /// Into this format, always into memory of its own.
  bool convert_to(PixelFormat format, const AVFrame& picture, RawImage& image);

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

}  // namespace raystage
