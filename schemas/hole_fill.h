// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace raystage::schemas {

/// Treatment of rays that no camera recorded.
enum class HoleFill {
  kNone,     ///< they remain transparent
  kPushPull  ///< push-pull interpolation from the surrounding pixels
};

}  // namespace raystage::schemas
