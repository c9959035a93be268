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

/// Renders the frame to its output file with the resources of a task, and records the attempt as
/// stage "measure". Returns nothing if the frame existed, as nothing was measured. Throws Error
/// (bad input or failed, as the renderer reports) if the frame cannot be rendered.
std::optional<FarmAttempt::End> measure_frame(const Measurement& measurement,
                                              const std::stop_token& stop);

}  // namespace raystage::farm
