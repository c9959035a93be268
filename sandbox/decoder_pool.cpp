// SPDX-License-Identifier: Apache-2.0
#include "sandbox/decoder_pool.h"

#include <optional>
#include <utility>

namespace raystage::sandbox {

DecoderPool::DecoderPool(DecoderOptions options) : options_(std::move(options)) {}

std::vector<std::byte> DecoderPool::decode(std::span<const std::byte> request,
                                           const std::filesystem::path& file,
                                           const OpenFile& open_file) const {
  std::optional<DecoderProcess> process;
  {
    const std::lock_guard lock(mutex_);
    if (!idle_.empty()) {
      process = std::move(idle_.back());
      idle_.pop_back();
    }
  }
  if (!process) process.emplace(options_);
  const auto give_back = [&] {
    const std::lock_guard lock(mutex_);
    idle_.push_back(std::move(*process));
  };
  try {
    std::vector<std::byte> result = process->decode(request, file, open_file);
    give_back();
    return result;
  } catch (...) {
    give_back();  // it starts its program again if need be
    throw;
  }
}

}  // namespace raystage::sandbox
