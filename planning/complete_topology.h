// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <numeric>
#include <vector>

#include "rig/rig.h"
#include "rig/topology.h"

namespace raystage::planning {

/// Returns the topology of all cameras of a rig.
inline rig::Topology complete_topology(const rig::Rig& rig) {
  std::vector<int> all(rig.cameras.size());
  std::iota(all.begin(), all.end(), 0);
  return rig::make_topology(rig, all);
}

}  // namespace raystage::planning
