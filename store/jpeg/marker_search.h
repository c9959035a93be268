// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace raystage::store {

/// Returns the offsets of the restart markers in `bytes` from `begin` on, and last that of the
/// first other marker (or the end of the bytes). An offset is that of the 0xFF next to the code.
std::vector<std::uint32_t> find_restart_markers(std::span<const std::byte> bytes,
                                                std::size_t begin);

}  // namespace raystage::store
