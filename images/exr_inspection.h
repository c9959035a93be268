// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

namespace raystage::images {

/// What an EXR file that Raystage rendered states of itself.
struct ExrInspection {
  /// Whether all chunks of all parts are there, and all parts state the same fingerprint.
  bool is_complete = false;
  std::string fingerprint = {};                  ///< `lf:fingerprint`; empty: none
  double covered_share = 1;                      ///< `lf:coveredShare`
  std::vector<std::string> rotten_cameras = {};  ///< `lf:rottenCameras`
};

}  // namespace raystage::images
