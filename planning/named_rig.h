// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "rig/rig.h"

namespace raystage::planning {

/// A rig in the world that it shares with others.
struct NamedRig {
  std::string name;
  rig::Rig rig;
};

}  // namespace raystage::planning
