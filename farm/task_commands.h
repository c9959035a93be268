// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "compose/shot_plan.h"
#include "farm/job_folder.h"

namespace raystage::farm {

/// The command lines of the programs that carry out a job's tasks, and the same settings for the
/// library.

/// `raystage-prepare` for one of the job's instants.
std::vector<std::string> prepare_command(const FarmJobDocument& job,
                                         const std::filesystem::path& shot, int instant,
                                         double memory_factor);
/// `raystage-render` for these frames; of a distributed job as ranks on all of its nodes. `task`:
/// of stage render.
std::vector<std::string> render_command(const FarmJobDocument& job,
                                        const std::filesystem::path& shot, int task,
                                        const std::string& frames, const std::string& existing,
                                        double memory_factor);
/// `raystage-preview` of all frames: a movie and a contact sheet in the job folder.
std::vector<std::string> preview_command(const FarmJobDocument& job, const JobFolder& folder);

/// What a job asks for in place of what its shot says, as options of a library call.
template <class Options>
void apply_picture_settings(const FarmJobDocument::OutputOverrides& picture, Options& options) {
  if (picture.fill == "none") options.fill = HoleFill::kNone;
  if (picture.fill == "push-pull") options.fill = HoleFill::kPushPull;
  options.layout = picture.layout;
  if (picture.coverage) options.aovs = {"lf.cameras", "lf.nearest"};
  if (picture.confidence) options.aovs.emplace_back("lf.confidence");
}

/// What ShotPlan needs to compute the fingerprints that those commands write.
ShotPlanOptions plan_options(const FarmJobDocument& job);
MissingFrames missing_frames_policy(const FarmJobDocument& job);

}  // namespace raystage::farm
