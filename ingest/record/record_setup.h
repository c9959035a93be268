// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "ingest/record/recorder.h"
#include "schemas/record_config.h"
#include "schemas/rig_document.h"
#include "schemas/take_document.h"

namespace raystage {

/// Opens one camera's source; given from outside, so that tests bring sources of their own.
using OpenFrameSource = std::function<std::unique_ptr<FrameSource>(const RecordConfig::Camera&)>;

/// All sources of a configuration, opened at once (network cameras take seconds each). Throws the
/// first Error that one of them throws.
std::vector<RecorderCamera> open_cameras(const RecordConfig& config, const OpenFrameSource& open);

RecorderSettings make_recorder_settings(const RecordConfig& config);

/// The cameras' geometry: from the rig that the configuration names, by id, or else a rig of
/// cameras side by side that says of itself that it is not calibrated. Throws Error (bad input)
/// where the rig lacks a camera or has another size than its source delivers.
RigDocument make_recording_rig(const RecordConfig& config,
                               const std::filesystem::path& config_folder,
                               const std::vector<RecorderCamera>& cameras);

/// RecordingTake::resume with these cameras. Throws Error (bad input) too where a source delivers
/// another size than the take's rig says, or what is to be recorded lies outside the times that the
/// take can hold: all its frames would be lost.
RecordingTake resume_take(const std::filesystem::path& folder,
                          const std::vector<RecorderCamera>& cameras, const std::string& node,
                          std::optional<Nanoseconds> start_utc = {},
                          std::optional<double> duration_s = {});

TakeDocument make_take_document(const RecordConfig& config,
                                const std::vector<RecorderCamera>& cameras, const std::string& node,
                                Nanoseconds epoch_utc, const std::string& created_by);

}  // namespace raystage
