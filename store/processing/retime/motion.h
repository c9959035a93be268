// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "store/jpeg/rgb_image.h"

namespace raystage {

/// One picture of a camera, with what motion is estimated from.
struct Picture {
  RgbImage rgb;
  std::vector<std::uint8_t> luma;  ///< one byte a pixel, in rows as `rgb`
};
Picture picture_of(RgbImage image);

/// Displacement, pixels: x to the right, y down.
struct Shift {
  float x = 0, y = 0;
};

/// Where each pixel of one picture is in another: at its own place plus its shift.
struct MotionField {
  int width = 0, height = 0;
  std::vector<Shift> shift;  ///< row by row
};

/// The median of x and of y over 5 x 5 pixels, in place: what moves unlike all around it was not
/// found but guessed (Sun, Roth and Black, "Secrets of optical flow estimation and their
/// principles", CVPR 2010). `shift`: row by row.
void take_median_shifts(std::vector<Shift>& shift, int width, int height);

/// Dense optical flow (OpenCV's DIS: Kroeger et al., "Fast optical flow using dense inverse
/// search", ECCV 2016), then medians. Keeps its scratch memory; one thread at a time. The same
/// pictures give the same field, as long as OpenCV is kept to one thread: see
/// use_one_opencv_thread().
class MotionEstimator {
 public:
  MotionEstimator();
  ~MotionEstimator();
  MotionEstimator(MotionEstimator&&) noexcept;
  MotionEstimator& operator=(MotionEstimator&&) noexcept;

  /// Both of one size and at most 32766 pixels either way, else Error (bad input). Pictures below
  /// 12 pixels either way show no motion.
  MotionField estimate(const Picture& from, const Picture& to);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// OpenCV splits DIS by threads, and its result with it. The setting is the whole process'.
void use_one_opencv_thread();

}  // namespace raystage
