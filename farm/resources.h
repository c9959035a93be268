// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>

#include "compose/shot_plan.h"
#include "schemas/farm_job_document.h"
#include "schemas/farm_records.h"

namespace raystage::farm {

/// The inputs of estimate_resources().
struct ResourceRequest {
  const compose::ShotPlan& plan;
  std::span<const compose::PlannedFrame> frames;
  bool deep = false;
  int threads = 1;                  ///< per task of stage render or prepare
  double memory_gb = 0;             ///< requested; 0: estimate it
  std::optional<int> minutes = {};  ///< requested; none: estimate it
  int longest_chunk = 1;            ///< frames
  /// The measured first frame; none: unknown.
  const std::optional<schemas::FarmAttempt::End>& measured;
};

/// Returns the resources of a task. Memory comes from the memory plan and is raised if the measured
/// frame took more. If a frame was measured, the time limit is four times the expected time of the
/// longest task, at least ten minutes.
schemas::FarmResources estimate_resources(schemas::FarmStage stage, const ResourceRequest& request);

/// Returns the disk space for one frame in bytes: a quarter of its uncompressed size.
double estimate_frame_bytes(const compose::ShotPlan& plan, bool deep);

}  // namespace raystage::farm
