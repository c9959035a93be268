// SPDX-License-Identifier: Apache-2.0
// Internal to compose/: checks and warnings before the first frame. Checks throw Error: bad input,
// or failed (disk).
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>

#include "compose/sequence.h"
#include "compose/sequence_name.h"

namespace raystage::compose {

/// Creates the folder and checks that files can be written to it.
void check_output_folder(const std::filesystem::path& folder);
/// Warns by SequenceOptions::on_message if the free disk space may not suffice.
void check_disk_space(const std::filesystem::path& folder, const ShotPlan& plan, std::size_t frames,
                      const SequenceOptions& options);
/// Throws Error if a file of the frames exists.
void check_existing_files(const SequenceName& name, std::span<const int> frames);
/// Throws Error if the sequence would overwrite a plate of the shot, at any frame of the shot.
void check_plates_not_overwritten(const ShotPlan& plan, const SequenceName& name,
                                  const std::filesystem::path& shot_file);
/// Returns the output name. Throws Error if frames would share a name or it does not end in .exr.
SequenceName checked_output_name(const SequenceOptions& options, std::size_t frames);
/// Throws Error if the shot uses anything that cannot be rendered from archives on several hosts.
void check_distributed_archives(const ShotPlan& plan, const std::filesystem::path& shot_file);
/// Throws Error if a method does not measure an AOV that is requested.
void check_requested_aovs(const ShotPlan& plan, const std::filesystem::path& shot_file);
/// Throws Error if the camera is equirectangular and the shot asks for what such views do not have.
void check_equirectangular_view(const ShotPlan& plan, const std::filesystem::path& shot_file);
/// Throws Error if deep output is requested and layers are not merged by depth, as readers do it.
void check_deep_output(const ShotPlan& plan, const std::filesystem::path& shot_file);

/// Returns "layer 2 (actor): ", or "" if the shot has one layer.
std::string layer_label(const ShotPlan& plan, std::size_t layer);

/// Warns by SequenceOptions::on_message of what is probably not intended: an uncalibrated rig,
/// frames for which a take has no light field frame, a focus pull without visible effect.
void report_sequence_warnings(const ShotPlan& plan, std::span<const PlannedFrame> frames,
                              const SequenceOptions& options);

}  // namespace raystage::compose
