// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <vector>

#include "base/time.h"
#include "schemas/recording_document.h"
#include "store/take.h"

namespace raystage::store {

/// Returns the recording reports of the nodes that recorded a take (TAKE/recording/*.json), by file
/// name; empty for an imported take. Throws Error (bad input) if a report cannot be read.
std::vector<schemas::RecordingDocument> read_recordings(const std::filesystem::path& take_folder);

/// Returns the times at which each camera's recorder was restarted (`raystage record --resume`), in
/// ns since the take's epoch, increasing, without the first start. Throws as read_recordings().
std::vector<std::vector<Nanoseconds>> recorder_restarts(const Take& take);

}  // namespace raystage::store
