// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace raystage {

/// Offsets of the restart markers (of their 0xFF next to the code) in `bytes` from `begin` on, and
/// last that of the first other marker. Without another marker they end at the end of the bytes.
std::vector<std::uint32_t> find_restart_markers(std::span<const std::byte> bytes,
                                                std::size_t begin);

}  // namespace raystage
