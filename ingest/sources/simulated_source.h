// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "ingest/sources/frame_source.h"
#include "schemas/record_config.h"

namespace raystage {

/// One camera of the simulated array in real time: free running with a phase and a rate of its own,
/// stamped by its node's clock, with a frame counter. A few frames wait for a late reader; the rest
/// is lost, and the counter shows it. Renders its frames now, unless another source with the same
/// settings has. Throws Error (bad input) for settings that cannot be.
std::unique_ptr<FrameSource> open_simulated_source(const RecordConfig::SimulatedSource& source);

}  // namespace raystage
