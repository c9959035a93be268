// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <OpenEXR/ImfFrameBuffer.h>

#include <cstddef>
#include <cstdint>

namespace raystage {

/// A slice of samples, `channels` of them a pixel, over a window `width` pixels wide that starts at
/// (x0, y0). OpenEXR takes the address of pixel (0, 0), which may lie outside the memory; it is
/// computed as a number because a pointer must not go there. `fill`: where the file has none.
template <class T>
Imf::Slice make_exr_slice(Imf::PixelType type, T* first, int width, int channels, int x0, int y0,
                          double fill) {
  const auto x_stride = static_cast<std::intptr_t>(sizeof(T)) * channels;
  const std::intptr_t y_stride = x_stride * width;
  const std::intptr_t base = reinterpret_cast<std::intptr_t>(first) - x0 * x_stride - y0 * y_stride;
  return {type,
          reinterpret_cast<char*>(base),
          static_cast<std::size_t>(x_stride),
          static_cast<std::size_t>(y_stride),
          1,
          1,
          fill};
}

}  // namespace raystage
