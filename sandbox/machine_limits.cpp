// SPDX-License-Identifier: Apache-2.0
#include "sandbox/machine_limits.h"

#include <algorithm>

#include "base/resources.h"

namespace raystage::sandbox {

std::size_t most_decoder_memory() { return available_memory() / 2; }

DecoderOptions within_machine(DecoderOptions options) {
  const std::size_t most = most_decoder_memory();
  if (options.memory_bytes > most) options.wanted_memory_bytes = options.memory_bytes;
  options.memory_bytes = std::min(options.memory_bytes, most);
  options.result_bytes = std::min<std::uint64_t>(options.result_bytes, most);
  return options;
}

}  // namespace raystage::sandbox
