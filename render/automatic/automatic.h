// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "render/common/method.h"

namespace raystage {

/// A way that `auto` may choose: a method with settings, and what it costs.
struct MethodCandidate {
  std::string label;  ///< for people
  const Method* method;
  OptionValues options = {};
  /// What it costs on one thread, nanoseconds: a pixel of the view; beside that, a pixel for each
  /// pixel of disparity_range(); and what an instant costs, for each pixel of its cameras. As
  /// measured on the machine of docs/benchmarks.md: constants, so that every node of a farm chooses
  /// alike.
  double pixel_ns = 0, disparity_ns = 0, instant_ns = 0;
};

/// What is asked of `auto`.
struct QualityTarget {
  double psnr_db = 0;  ///< at least; 0: as near to the truth as can be
  /// At most, on two threads; 0: however long it takes. To render alone, from decoded frames, with
  /// one sample a pixel: how many a view takes (ViewRequest::supersampling) changes along a shot,
  /// the choice must not.
  double seconds_per_frame = 0;
  /// How deep the scene is, where the take does not say or says otherwise.
  std::optional<DepthRange> scene = std::nullopt;
};

struct MethodChoice {
  std::size_t candidate = 0;
  std::string why;                          ///< a line for people
  bool meets_target_leave_one_out = false;  ///< its error was measured and meets the target
  /// Where methods that need a plane look rays up: eq. 2.2's. None where nobody says how deep the
  /// scene is: each view's own, which is no part of the choice.
  std::optional<Eigen::Vector4d> focal_plane = std::nullopt;
};

/// Chooses among `candidates`, which stand from the least to the most accurate. A single plane (the
/// first) wherever eq. 2.1 says that it is free of ghosts. Else, of those within the time, the
/// cheapest that meets the target at cameras that are left out for it:
/// with LeaveOneOutQuality::expected_db(), and 85 % of their pictures covered. The most accurate
/// where none does, none is asked for or no camera can be left out. What was not measured is never
/// called to meet the target. That is an estimate of views among the cameras, with a margin for
/// where they stand and what they show; of views off the array, which no camera tells of, see
/// extrapolation_note(). Depends on the take, the options and the size of the picture alone: every
/// frame of a shot and every node of a farm gets the same answer. Costs up to nine pictures of the
/// cameras for each candidate but the last.
MethodChoice choose(std::span<const MethodCandidate> candidates, const QualityTarget& target,
                    const ViewRequest& request);

/// `auto` over these.
const Method& automatic_method();

}  // namespace raystage
