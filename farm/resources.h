// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>

#include "compose/shot_plan.h"
#include "schemas/farm_job_document.h"
#include "schemas/farm_records.h"

namespace raystage::farm {

/// What a task of each stage may use is estimated from this.
struct ResourceRequest {
  const ShotPlan& plan;
  std::span<const PlannedFrame> frames;
  bool deep = false;
  int threads = 1;                                  ///< of a task that renders or prepares
  double memory_gb = 0;                             ///< as given; 0: estimated
  std::optional<int> minutes = {};                  ///< as given
  int longest_chunk = 1;                            ///< frames
  const std::optional<FarmAttempt::End>& measured;  ///< of the first frame
};

/// Memory from the memory plan, raised where the measured frame took more; the time limit four
/// times what the longest task should take, at least ten minutes, where a frame was measured.
FarmResources estimate_resources(FarmStage stage, const ResourceRequest& request);

/// Room for one frame on the output disk, bytes: a quarter of what it takes uncompressed.
double estimate_frame_bytes(const ShotPlan& plan, bool deep);

}  // namespace raystage::farm
