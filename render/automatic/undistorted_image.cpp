// SPDX-License-Identifier: Apache-2.0
// Resamples a frame without lens distortion, bilinearly in its codes, and converts it to 8-bit sRGB
// codes. Pixels that the frame does not show stay black. Cost: O(pixels), rows in parallel.
#include "render/automatic/undistorted_image.h"

#include <algorithm>
#include <cmath>

#include "base/parallel.h"
#include "base/transfer_function.h"

namespace raystage::render {
namespace {

/// Returns one channel at a position within the frame, [0, 1].
double code_at(const store::DecodedFrame& frame, double x, double y, std::size_t channel) {
  const double left = std::clamp(x - 0.5, 0.0, frame.width - 1.0);
  const double top = std::clamp(y - 0.5, 0.0, frame.height - 1.0);
  const int x0 = static_cast<int>(left), y0 = static_cast<int>(top);
  const double fx = left - x0, fy = top - y0;
  const auto code = [&](int i, int j) {
    const auto row = static_cast<std::size_t>(std::min(y0 + j, frame.height - 1));
    const auto column = static_cast<std::size_t>(std::min(x0 + i, frame.width - 1));
    return frame.rgba[(row * frame.width + column) * 4 + channel] / 65535.0;
  };
  return (1 - fy) * ((1 - fx) * code(0, 0) + fx * code(1, 0)) +
         fy * ((1 - fx) * code(0, 1) + fx * code(1, 1));
}

}  // namespace

UndistortedImage undistort_frame(const store::DecodedFrame& frame, const rig::CameraModel& model,
                                 double full_scale, store::BlendSpace space) {
  const auto pixels = static_cast<std::size_t>(frame.width) * frame.height;
  UndistortedImage picture{{frame.width, frame.height}, {}};
  picture.within.assign(pixels, 0);
  const schemas::Intrinsics& k = model.intrinsics();
  raystage::parallel_for(0, frame.height, [&](int y) {
    std::size_t at = static_cast<std::size_t>(y) * frame.width;
    for (int x = 0; x < frame.width; ++x, ++at) {
      const auto pixel = model.pixel_from_ideal({(x + 0.5 - k.cx) / k.fx, (y + 0.5 - k.cy) / k.fy});
      if (!pixel || !model.contains(*pixel)) continue;
      picture.within[at] = 1;
      for (std::size_t c = 0; c < 3; ++c) {
        const double code = code_at(frame, pixel->x(), pixel->y(), c);
        const double linear = full_scale * store::part_from_value(space, code);
        picture.image.values[at * 3 + c] = static_cast<std::uint8_t>(
            std::lround(255 * srgb_from_linear(std::clamp(linear, 0.0, 1.0))));
      }
    }
  });
  return picture;
}

}  // namespace raystage::render
