// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "ingest/record/recorder.h"
#include "schemas/record_config.h"
#include "schemas/rig_document.h"

namespace raystage::ingest {

/// Opens the source of one camera; a parameter so that tests can supply their own sources.
using OpenFrameSource =
    std::function<std::unique_ptr<FrameSource>(const schemas::RecordConfig::Camera&)>;

/// Opens all sources of a configuration in parallel (a network camera takes seconds). A camera that
/// cannot be opened, or whose frames have another size than in `rig` or are too large for the
/// memory, is absent (RecorderCamera::absence): the others are recorded, and it is tried again.
/// `rig`: of the take; null: there is none yet, and absent cameras are taken to have the size of
/// most others. Throws the first ConfigurationError of a camera, as it would never come. Throws the
/// first Error if all cameras are absent, or one is where a lost camera stops the recording.
std::vector<RecorderCamera> open_cameras(const schemas::RecordConfig& config,
                                         const OpenFrameSource& open,
                                         const schemas::RigDocument* rig = nullptr);

}  // namespace raystage::ingest
