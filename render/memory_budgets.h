// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

#include "render/renderer.h"

namespace raystage::render {

/// Returns whether the method needs memory only for decoded frames; see Method::caches_frames_only.
bool caches_frames_only(const ReconstructionOptions& reconstruction);

/// Memory budgets, bytes.
struct MemoryBudgets {
  std::size_t cache = 0;  ///< decoded source frames
  std::size_t result_cache = 0;
  std::size_t working = 0;  ///< working memory of the method
};

/// Divides the memory of a renderer. A method that needs more than decoded frames gets a quarter
/// for the result cache and a quarter as working memory. For other methods all memory is for
/// decoded frames.
MemoryBudgets split_memory_budget(std::size_t bytes, const ReconstructionOptions& reconstruction);

}  // namespace raystage::render
