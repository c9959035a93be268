// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <string>

#include "compose/sequence.h"
#include "compose/shot_plan.h"

namespace raystage {

/// "layer 2 (actor): "; nothing where the shot has one layer alone.
std::string layer_text(const ShotPlan& plan, std::size_t layer);

/// Tells what will be rendered and is likely not meant: a rig that nobody calibrated, frames for
/// which a take has nothing, a focus that moves without anything to be seen of it.
void say_what_is_missing(const ShotPlan& plan, std::span<const PlannedFrame> frames,
                         const SequenceOptions& options);

}  // namespace raystage
