// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "store/processing/retime/motion.h"

namespace raystage {

/// How a picture for a moment between two frames is made. The numbers mean nothing outside.
enum class RetimeMethod {
  kNearest,  ///< the nearer frame as it is
  kBlend,    ///< the mean of both, weighted by time: what moves is seen twice
  kFlow      ///< what moves is moved
};

/// (1 - part) a + part b, code by code. `part` in [0, 1]: how far from a to b. Both of one size.
RgbImage blend(const RgbImage& a, const RgbImage& b, double part);

/// The picture at `part` in [0, 1] of the way from a to b, from the motion both ways.
/// The motion at that moment is what the pixels of a and b bring along, of several at one place the
/// one along which a and b look most alike, over a small window; places that nothing comes to take
/// their neighbours' (Baker et al., "A database and evaluation methodology for optical flow", IJCV
/// 2011, section 3.3.2); then medians, so that no pixel moves alone. A pixel is then sought in a
/// and in b along this motion. Where the motion found there is another, that picture shows
/// something else in front: it is hidden there, and the other picture alone is used.
RgbImage in_between(const Picture& a, const Picture& b, const MotionField& b_from_a,
                    const MotionField& a_from_b, double part);

}  // namespace raystage
