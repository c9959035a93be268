// SPDX-License-Identifier: Apache-2.0
// raystage-motion.so, in lib/raystage: what uses OpenCV, see motion_module.h.
#include <opencv2/core/utility.hpp>

#include "store/processing/motion/motion_module.h"
#include "store/processing/motion/opencv_flow.h"
#include "store/processing/motion/opencv_interpolation.h"

namespace raystage::store {
namespace {

class OpencvMotion final : public MotionModule {
 public:
  std::unique_ptr<FlowAlgorithm> make_flow() const override { return make_opencv_flow(); }
  void interpolate_codes(const MovingPair& pair, const InstantBetween& instant,
                         std::span<const std::uint8_t> a, std::span<const std::uint8_t> b,
                         std::span<std::uint8_t> out) const override {
    store::interpolate_codes(pair, instant, a, b, out);
  }
  void interpolate_levels(const MovingPair& pair, const InstantBetween& instant,
                          std::span<const std::uint16_t> a, std::span<const std::uint16_t> b,
                          std::span<std::uint16_t> out) const override {
    interpolate_rgba_levels(pair, instant, a, b, out);
  }
  void use_one_thread() const override { cv::setNumThreads(1); }
};

}  // namespace
}  // namespace raystage::store

extern "C" __attribute__((visibility("default"))) raystage::store::MotionModule*
raystage_open_motion_module_1() {
  return new raystage::store::OpencvMotion();
}
