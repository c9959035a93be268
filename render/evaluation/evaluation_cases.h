// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "render/common/view.h"
#include "render/evaluation/evaluation.h"
#include "render/evaluation/undistorted_ground_truth.h"
#include "store/timeline.h"

namespace raystage {

/// A view to evaluate, what it is rendered from, and where its truth comes from.
struct EvaluationCase {
  std::string id;
  VirtualCamera camera;
  FrameSelection frames;
  std::function<GroundTruth()> truth;
};

/// Throws Error (bad input) where the take has no such camera.
int camera_named(const Take& take, const std::string& id);

/// The views of the document and of the cameras left out, every settings.view_step-th of them.
///
/// Instants are chosen as a shot chooses them: a view shows the timeline's tick nearest to its
/// time, and nothing where that is more than half a tick outside; a camera left out has a view for
/// each tick that takes a frame of it, ID_TICK, or ID in a still. Where there is no timeline
/// (null), stamps choose: a view shows each camera's frame nearest to its time within
/// tolerance_of_stamps(), and a camera left out has a view for each of its frames, ID_FRAME.
///
/// The take must outlive them. Throws Error (bad input): unknown camera, no view at all.
std::vector<EvaluationCase> make_evaluation_cases(const Take& take, const Timeline* timeline,
                                                  const ViewsDocument& views,
                                                  const std::filesystem::path& views_folder,
                                                  const EvaluationSettings& settings);

}  // namespace raystage
