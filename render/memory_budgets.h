// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

#include "render/renderer.h"

namespace raystage {

/// Whether the method wants no memory but for decoded frames; see Method::caches_frames_only.
bool caches_frames_only(const ReconstructionSettings& reconstruction);

/// Of memory, bytes.
struct MemoryBudgets {
  std::size_t cache = 0;    ///< decoded source frames
  std::size_t kept = 0;     ///< what the method works out once
  std::size_t working = 0;  ///< what it works with
};

/// A method that needs more than decoded frames gets a quarter of the memory for what it keeps, and
/// a quarter to work with; any other all of it for these.
MemoryBudgets split_memory_budget(std::size_t bytes, const ReconstructionSettings& reconstruction);

}  // namespace raystage
