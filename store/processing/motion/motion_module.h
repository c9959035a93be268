// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "store/processing/motion/frame_interpolation.h"
#include "store/processing/motion/optical_flow.h"

namespace raystage::store {

/// Estimates dense flow, see OpticalFlowEstimator.
class FlowAlgorithm {
 public:
  virtual ~FlowAlgorithm() = default;
  virtual FlowField estimate(const Luma& from, const Luma& to) = 0;
};

/// Interface of the module lib/raystage/raystage-motion.so: what uses OpenCV. It is a module
/// because OpenCV and the 17 libraries that it loads would add a quarter to the start of every
/// command that reads frames, and only shots at exact times or with motion blur need them. For the
/// functions see optical_flow.h and frame_interpolation.h. Thread-safe.
class MotionModule {
 public:
  virtual ~MotionModule() = default;
  virtual std::unique_ptr<FlowAlgorithm> make_flow() const = 0;
  /// Interpolates 8-bit codes, R, G, B per pixel, rows without padding.
  virtual void interpolate_codes(const MovingPair& pair, const InstantBetween& instant,
                                 std::span<const std::uint8_t> a, std::span<const std::uint8_t> b,
                                 std::span<std::uint8_t> out) const = 0;
  /// Interpolates 16-bit levels, R, G, B, A per pixel.
  virtual void interpolate_levels(const MovingPair& pair, const InstantBetween& instant,
                                  std::span<const std::uint16_t> a,
                                  std::span<const std::uint16_t> b,
                                  std::span<std::uint16_t> out) const = 0;
  virtual void use_one_thread() const = 0;
};

/// Entry point of the module, under this name. The caller owns the result. Raise the number when
/// the interface changes: a module of another version is refused then.
using OpenMotionModule = MotionModule*();
inline constexpr const char* kOpenMotionModule = "raystage_open_motion_module_1";
inline constexpr const char* kMotionModule = "raystage-motion.so";

/// Returns the module, which is loaded at the first call. Throws Error (failed) if it is missing.
const MotionModule& motion_module();

}  // namespace raystage::store
