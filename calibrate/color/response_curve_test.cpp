// SPDX-License-Identifier: Apache-2.0
#include "calibrate/color/response_curve.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/error.h"
#include "base/transfer_function.h"
#include "rig/photometric_model.h"

namespace raystage::calibrate {
namespace {

/// Returns whole codes of a channel for locations with a range of light at several exposures.
/// `true_code` is the curve that linearises them.
template <typename Straight>
std::vector<ResponseSample> shown_by(const Straight& true_code, double black) {
  std::vector<ResponseSample> codes;
  for (const double exposure : {0.0, 1.0, 2.0, 4.0, 8.0}) {
    for (int location = 0; location < 40; ++location) {
      const double light = (0.05 + 0.06 * location / 40) * exposure + black;
      if (light > 0.95) continue;
      int code = 0;
      while (code < 255 && linear_from_srgb(true_code((code + 0.5) / 255)) < light) ++code;
      codes.push_back({location, exposure, code / 255.0});
    }
  }
  return codes;
}

TEST(ResponseCurve, MakesLightFollowExposure) {
  for (const double power : {0.85, 1.0, 1.15}) {
    const auto straight = [&](double code) { return std::pow(code, power); };
    const auto curve = fit_response_curve(shown_by(straight, 0.01), "srgb_texture");
    // Compares up to scale and offset of light, which contrast and brightness compensate.
    const auto found = [&](int code) {
      return linear_from_srgb(rig::evaluate_response_curve(curve, code / 255.0));
    };
    const auto truth = [&](int code) { return linear_from_srgb(straight(code / 255.0)); };
    const double scale = (found(220) - found(60)) / (truth(220) - truth(60));
    const double offset = found(60) - scale * truth(60);
    EXPECT_NEAR(scale, 1, 0.05);
    EXPECT_NEAR(offset, 0, 0.005);
    for (int code = 40; code <= 240; code += 10) {
      const double expected = offset + scale * truth(code);
      EXPECT_NEAR(found(code), expected, 0.005 * expected + 0.0005)
          << "power " << power << ", code " << code;
    }
  }
}

TEST(ResponseCurve, NeedsTwoExposuresThatShowAnything) {
  const std::vector<ResponseSample> one{{0, 0, 0.1}, {0, 2, 0.5}, {1, 2, 0.6}};
  EXPECT_THROW(fit_response_curve(one, "srgb_texture"), Error);
}

}  // namespace
}  // namespace raystage::calibrate
