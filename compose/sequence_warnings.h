// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <string>

#include "compose/sequence.h"
#include "compose/shot_plan.h"

namespace raystage {

/// Returns "layer 2 (actor): ", or "" if the shot has one layer.
std::string layer_label(const ShotPlan& plan, std::size_t layer);

/// Warns by SequenceOptions::on_message of what is probably not intended: an uncalibrated rig,
/// frames for which a take has no light field frame, a focus pull without visible effect.
void report_sequence_warnings(const ShotPlan& plan, std::span<const PlannedFrame> frames,
                              const SequenceOptions& options);

}  // namespace raystage
