// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "render/common/method.h"

namespace raystage::render {

/// A candidate of `auto`: a method with options, and its cost.
struct MethodCandidate {
  std::string label;  ///< for people
  const Method* method;
  schemas::OptionValues options = {};
  /// Cost on one thread in nanoseconds: per pixel of the view; in addition, per pixel of the view
  /// and pixel of disparity_range(); and per light field frame, for each pixel of its cameras. The
  /// costs were measured on the machine of docs/benchmarks.md and are constant, so that every node
  /// of a farm chooses alike.
  double pixel_ns = 0, disparity_ns = 0, instant_ns = 0;
};

/// The quality target of `auto`.
struct QualityTarget {
  double psnr_db = 0;  ///< least PSNR; 0: as accurate as possible
  /// Largest render time on two threads; 0: no limit. It covers rendering alone, from decoded
  /// frames, with one sample per pixel: supersampling (ViewRequest::supersampling) changes along a
  /// shot, but the choice must not.
  double seconds_per_frame = 0;
  /// Depth range of the scene, where the take has none or another one is given.
  std::optional<schemas::DepthRange> scene = std::nullopt;
};

struct MethodChoice {
  std::size_t candidate = 0;
  std::string why;                          ///< a line for the user
  bool meets_target_leave_one_out = false;  ///< whether its error was measured and meets the target
  /// The focal plane for methods that need one (eq. 2.2). Nullopt where the depth range of the
  /// scene is unknown: each view then uses its own plane.
  std::optional<Eigen::Vector4d> focal_plane = std::nullopt;
};

/// Chooses among `candidates`, which are ordered from the least to the most accurate. A single
/// plane (the first candidate) is chosen wherever eq. 2.1 says that it is free of ghosts. Otherwise
/// the cheapest candidate within the time limit that meets the target at left-out cameras is
/// chosen. It meets the target if LeaveOneOutQuality::expected_db() reaches it with at least 85 %
/// of the images covered. The most accurate is chosen where none meets it, no target is set or no
/// camera can be left out. A candidate that was not measured is never reported to meet the target.
/// This estimates views among the cameras, with a margin for their positions and contents. It says
/// nothing about views off the array: see extrapolation_note(). The choice depends only on the
/// take, the options and the image size: every frame of a shot and every node of a farm gets the
/// same answer. Cost: up to nine renderings of cameras for each candidate but the last.
MethodChoice choose(std::span<const MethodCandidate> candidates, const QualityTarget& target,
                    const ViewRequest& request);

/// Returns the method `auto`.
const Method& automatic_method();

}  // namespace raystage::render
