// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "ingest/sources/frame_source.h"
#include "schemas/record_config.h"

namespace raystage::ingest {

/// Opens one camera of the simulated array in real time: free-running with its own phase and rate,
/// with time stamps of its node's clock and a frame counter. A few frames wait for a late reader;
/// more are dropped, and the counter shows it. Renders the frames now, unless another source with
/// the same settings has done so. Throws Error (bad input) for invalid settings.
std::unique_ptr<FrameSource> open_simulated_source(
    const schemas::RecordConfig::SimulatedSource& source);

}  // namespace raystage::ingest
