// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "evaluation/evaluation.h"
#include "evaluation/undistorted_ground_truth.h"
#include "render/common/view.h"
#include "store/timeline.h"

namespace raystage::evaluation {

struct EvaluationCase {
  std::string id;
  render::VirtualCamera camera;
  store::FrameSelection frames;
  std::function<GroundTruth()> truth;
};

/// Returns a camera's index. Throws Error (bad input) if the take has no such camera.
int camera_named(const store::Take& take, const std::string& id);

/// Reads a views document. Truths are files below its folder and not behind links, unless links are
/// permitted (permits_links()): a stranger's document must not show the files of its user. Their
/// names become relative to the working directory. Throws Error (bad input).
schemas::ViewsDocument read_views_with_truths(const std::filesystem::path& file);

/// Returns the views of the document and of the excluded cameras, every settings.view_step-th of
/// them.
///
/// Instants are selected as in a shot. A view shows the timeline's tick nearest to its time, and
/// nothing if it is more than half a tick outside. An excluded camera has a view per tick that
/// takes a frame of it, named ID_TICK, or ID in a still. Without a timeline (null), time stamps
/// select. A view then shows each camera's frame nearest to its time within
/// default_frame_tolerance(). An excluded camera has a view per frame, named ID_FRAME.
///
/// With exact times a view shows its own time, and a view of an excluded camera that of its frame.
///
/// The take must outlive the result. Throws Error (bad input): unknown camera, no view at all.
std::vector<EvaluationCase> make_evaluation_cases(const store::Take& take,
                                                  const store::Timeline* timeline,
                                                  const schemas::ViewsDocument& views,
                                                  const std::filesystem::path& views_folder,
                                                  const EvaluationOptions& options);

}  // namespace raystage::evaluation
