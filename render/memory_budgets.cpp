// SPDX-License-Identifier: Apache-2.0
#include "render/memory_budgets.h"

#include "render/methods.h"

namespace raystage::render {

bool caches_frames_only(const ReconstructionOptions& reconstruction) {
  const Method& method = method_named(reconstruction.method);
  return method.caches_frames_only(
      MethodOptions(method.options(), reconstruction.options, method.name()));
}

MemoryBudgets split_memory_budget(std::size_t bytes, const ReconstructionOptions& reconstruction) {
  if (caches_frames_only(reconstruction)) return {bytes, 0, 0};
  const std::size_t quarter = bytes / 4;
  return {bytes - 2 * quarter, quarter, quarter};
}

}  // namespace raystage::render
