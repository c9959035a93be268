// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "store/timeline.h"

namespace raystage::store {

/// Returns the timeline of a take that needs no resynchronisation: each camera has at most one
/// frame (an instant, whatever its time stamps are), or the time stamps of all cameras agree and
/// have a constant rate. Returns nullopt for other takes, and if archives are on other hosts.
std::optional<Timeline> timeline_without_sync(const Take& take);

}  // namespace raystage::store
