// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <stop_token>

#include "farm/job_folder.h"

namespace raystage::farm {

/// A frame to be rendered on this host before a job is queued.
struct Measurement {
  const JobFolder& folder;
  const FarmJobDocument& job;  ///< with its paths as this host sees them
  std::filesystem::path shot;
  int frame = 0;
};

/// Renders the frame into its place with the resources of a task, and records the attempt as stage
/// "measure". None: the frame existed, so nothing was measured. Throws Error where it cannot be
/// rendered: bad input or failed, as the renderer says.
std::optional<FarmAttempt::End> measure_frame(const Measurement& measurement,
                                              const std::stop_token& stop);

}  // namespace raystage::farm
