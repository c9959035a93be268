// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "store/processing/retime/optical_flow.h"

namespace raystage::store {

/// The method that computes a frame at a time between two frames. Values are not part of any
/// format.
enum class RetimeMethod {
  kNearest,  ///< the nearer frame, unchanged
  kBlend,    ///< the mean weighted by time; moving objects appear twice
  kFlow      ///< interpolation along optical flow
};

/// Returns (1 - part) a + part b, code by code. `part` in [0, 1], from a to b. Equal sizes.
RgbImage blend(const RgbImage& a, const RgbImage& b, double part);

/// Returns the frame at time fraction `part` in [0, 1] between a and b, from the optical flow in
/// both directions. Flow vectors are projected to that time. Where several land on one pixel, the
/// one with the smallest difference of a and b over a small window is kept. Holes take their
/// neighbours' vectors (Baker et al., "A database and evaluation methodology for optical flow",
/// IJCV 2011, section 3.3.2). A median filter removes outliers. Each pixel then samples a and b
/// along its vector. A frame whose own flow differs there is occluded and gets almost no weight.
RgbImage interpolate_frame(const FlowImage& a, const FlowImage& b, const FlowField& b_from_a,
                           const FlowField& a_from_b, double part);

}  // namespace raystage::store
