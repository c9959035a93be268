// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string_view>
#include <vector>

#include "render/depth/inverse_depth_map.h"

namespace raystage {

/// Depths as a file keeps them: multiples of a power of two, 65534 at most. Solved depths are
/// brought to these, so that a view does not depend on whether they were found or read.
void quantise_depths(InverseDepthMap& map);

/// Takes a file's bytes, block by block.
using WriteBytes = std::function<void(std::span<const std::byte> block)>;

/// Writes the file; layout in docs/formats/depth.md. Maps as quantise_depths() leaves them are kept
/// to the bit. Memory: as for one map, and some megabytes for zstd.
void encode_depth_maps(std::span<const InverseDepthMap> maps, std::uint64_t fingerprint,
                       const WriteBytes& write);

/// Reads any bytes; no more memory is taken than maps of the sizes of `expected` (whose values are
/// not looked at) need, and some megabytes for zstd. Throws Error (bad input): damaged, of another
/// version, with another fingerprint, of maps of other sizes.
std::vector<InverseDepthMap> decode_depth_maps(std::span<const std::byte> file,
                                               std::uint64_t fingerprint,
                                               std::span<const VirtualCamera> expected,
                                               std::string_view name);

}  // namespace raystage
