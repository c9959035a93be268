// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace raystage {

/// What becomes of rays that no camera saw.
enum class HoleFill {
  kNone,     ///< they stay transparent
  kPushPull  ///< coloured from what was seen around them
};

}  // namespace raystage
