// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <stop_token>
#include <string>
#include <vector>

#include "calibrate/color/color_match.h"
#include "schemas/geometry.h"
#include "schemas/rig_document.h"

namespace raystage::calibrate {

/// The takes that show targets, a chart or a scene, and what is estimated from them. Paths may be
/// empty.
struct ColorFromTakesOptions {
  std::vector<std::filesystem::path> targets;  ///< each shows a flat target of another brightness
  std::filesystem::path dark;                  ///< lenses capped; needs targets
  std::vector<double> exposures;     ///< relative exposure of each target, for response curves
  std::filesystem::path chart;       ///< shows a ColorChecker Classic
  std::filesystem::path scene;       ///< shows any scene; needs a rig with known poses
  std::string reference;             ///< id of the camera to match; empty: the first
  schemas::DepthRange depths{0, 0};  ///< of the scene, metres in front of the array; 0: the take's
  double focal_depth = 0;            ///< only surfaces within 10 % of it, metres; 0: `depths`
  bool neutral = false, vignetting = false, flat_field = false;  ///< see FlatFieldMatchOptions
  bool use_published_values = false;                             ///< see ChartMatchOptions
};

/// Colour responses of an array, step by step: targets, chart, scene.
struct ColorFromTakes {
  std::vector<std::string> cameras;  ///< ids
  int reference = 0;                 ///< index into `cameras`
  std::vector<ColorMatch> steps;     ///< each refines the step before; at least one

  bool is_accepted() const;
  const std::string& reference_id() const { return cameras[reference]; }
};

/// Estimates the colour response of every camera (thesis 4.3). `rig` describes the cameras;
/// `rig_file` names it in errors. Calls `progress` with the share that is done, in [0, 1]. Throws
/// Error (bad input) for takes of other cameras or frame sizes, and for exposures that contradict
/// the pictures. It also throws it for a scene whose rig has no poses, and Error (failed) if a stop
/// is requested.
ColorFromTakes calibrate_color(const ColorFromTakesOptions& options,
                               const schemas::RigDocument& rig,
                               const std::filesystem::path& rig_file,
                               const std::function<void(double)>& progress,
                               const std::stop_token& stop);

/// Returns the rig with the estimated responses. Throws Error (bad input) for a camera of the rig
/// that the takes do not have.
schemas::RigDocument with_color_responses(schemas::RigDocument rig,
                                          const std::filesystem::path& rig_file,
                                          const ColorFromTakes& found);

}  // namespace raystage::calibrate
