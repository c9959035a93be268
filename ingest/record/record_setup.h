// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "ingest/record/recorder.h"
#include "schemas/record_config.h"
#include "schemas/rig_document.h"
#include "schemas/take_document.h"

namespace raystage::ingest {

RecorderOptions make_recorder_options(const schemas::RecordConfig& config);

/// Returns the geometry of the cameras, by id from the rig that the configuration names. Without a
/// rig it returns cameras in a row, marked as not calibrated (kUncalibratedRigName). Throws Error
/// (bad input) if the rig lacks a camera or its size differs from that of the source.
schemas::RigDocument make_recording_rig(const schemas::RecordConfig& config,
                                        const std::filesystem::path& config_folder,
                                        const std::vector<RecorderCamera>& cameras);

/// Calls RecordingTake::resume with these cameras. Also throws Error (bad input) if the size of a
/// source differs from the take's rig. The same applies if the recording would begin before the
/// take's epoch or end after the longest time of a take, as its frames would be lost.
RecordingTake resume_take(const std::filesystem::path& folder,
                          const std::vector<RecorderCamera>& cameras, const std::string& node,
                          std::optional<Nanoseconds> start_utc = {},
                          std::optional<double> duration_s = {},
                          const std::filesystem::path& other = {});

schemas::TakeDocument make_take_document(const schemas::RecordConfig& config,
                                         const std::vector<RecorderCamera>& cameras,
                                         const std::string& node, Nanoseconds epoch_utc,
                                         const std::string& created_by);

}  // namespace raystage::ingest
