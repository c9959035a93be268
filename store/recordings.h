// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <vector>

#include "base/time.h"
#include "schemas/recording_document.h"
#include "store/take.h"

namespace raystage {

/// The accounts of the nodes that recorded a take, TAKE/recording/*.json, by file name; none of a
/// take that was imported. Throws Error (bad input) for an account that cannot be read.
std::vector<RecordingDocument> recordings_of(const std::filesystem::path& take_folder);

/// When `raystage record` started anew on each camera (`--resume`), ns since the take's epoch,
/// increasing; its first start is none. Throws as recordings_of().
std::vector<std::vector<Nanoseconds>> recorder_restarts(const Take& take);

}  // namespace raystage
