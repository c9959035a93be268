// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace raystage::compose {

/// How the two views of a stereo frame become one picture.
enum class StereoPacking {
  kNone,        ///< only the left view
  kSideBySide,  ///< left, right
  kTopBottom    ///< left above right
};

}  // namespace raystage::compose
