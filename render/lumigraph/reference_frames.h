// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <memory>
#include <vector>

#include "render/common/light_field_frame.h"
#include "render/common/view.h"
#include "render/lumigraph/ray_weights.h"

namespace raystage {

/// All frames of an instant, whole, and look-ups in them in double: for the references.
class ReferenceFrames {
 public:
  ReferenceFrames(const LightFieldFrame& instant, bool count_needed, RenderStatistics& statistics);

  const std::vector<int>& present() const { return present_; }

  /// R, G, B, A, premultiplied linear light, of cameras weighed for one ray; A is the most that one
  /// of them sees. Thread-safe.
  std::array<float, 4> blend(const std::vector<WeightedCamera>& cameras);

  std::int64_t pixels_needed() const;

 private:
  const LightFieldFrame& instant_;
  std::vector<int> present_;
  std::vector<std::shared_ptr<const DecodedFrame>> frames_;
  std::vector<std::vector<std::uint8_t>> read_;  ///< per camera and pixel; empty: not asked for
};

}  // namespace raystage
