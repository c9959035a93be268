// SPDX-License-Identifier: Apache-2.0
#include "render/memory_shares.h"

#include "render/methods.h"

namespace raystage {

bool wants_frames_only(const Reconstruction& reconstruction) {
  const Method& method = method_named(reconstruction.method);
  return method.caches_frames_only(
      MethodOptions(method.options(), reconstruction.options, method.name()));
}

MemoryShares share_memory(std::size_t bytes, const Reconstruction& reconstruction) {
  if (wants_frames_only(reconstruction)) return {bytes, 0, 0};
  const std::size_t quarter = bytes / 4;
  return {bytes - 2 * quarter, quarter, quarter};
}

}  // namespace raystage
