// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "compose/shot_plan.h"
#include "farm/job_folder.h"

namespace raystage::farm {

/// Returns the `raystage-prepare` command for one of the job's instants.
std::vector<std::string> prepare_command(const schemas::FarmJobDocument& job,
                                         const std::filesystem::path& shot, int instant,
                                         double memory_factor);
/// Returns the `raystage-render` command for the frames of a task of stage render. For a
/// distributed job it starts ranks on all of the job's nodes.
std::vector<std::string> render_command(const schemas::FarmJobDocument& job,
                                        const std::filesystem::path& shot, int task,
                                        const std::string& frames, const std::string& existing,
                                        double memory_factor);
/// Returns the `raystage-preview` command that makes a movie and a contact sheet of all frames in
/// the job folder.
std::vector<std::string> preview_command(const schemas::FarmJobDocument& job,
                                         const JobFolder& folder);

/// Applies the job's output settings, which replace those of its shot, to the options of a library
/// call.
template <class Options>
void apply_picture_settings(const schemas::FarmJobDocument::OutputOverrides& picture,
                            Options& options) {
  if (picture.fill == "none") options.fill = schemas::HoleFill::kNone;
  if (picture.fill == "push-pull") options.fill = schemas::HoleFill::kPushPull;
  options.layout = picture.layout;
  if (picture.coverage) options.aovs = {"lf.cameras", "lf.nearest"};
  if (picture.confidence) options.aovs.emplace_back("lf.confidence");
}

/// Returns the options with which ShotPlan computes the fingerprints that those commands write.
compose::ShotPlanOptions plan_options(const schemas::FarmJobDocument& job);
compose::MissingFrames missing_frames_policy(const schemas::FarmJobDocument& job);

}  // namespace raystage::farm
