// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string_view>
#include <vector>

#include "render/depth/inverse_depth_map.h"

namespace raystage::render {

inline constexpr float kMaxDepthSteps = 65534;

/// Returns the step in which a file stores a map's depths, 1/m: the smallest power of two of which
/// no depth exceeds kMaxDepthSteps. Exact in float.
float depth_step(const InverseDepthMap& map);

/// Rounds depths to the values that a file stores: multiples of a power of two, at most 65534 of
/// them. Estimated depths are rounded too, so that a view is the same if they are read.
void quantise_depths(InverseDepthMap& map);

/// Receives the bytes of a file, block by block.
using WriteBytes = std::function<void(std::span<const std::byte> block)>;

/// Encodes maps as a file (docs/formats/depth.md) and gives its bytes to `write`. Lossless for maps
/// that quantise_depths() rounded. Memory: that of one map, and some megabytes for zstd.
void encode_depth_maps(std::span<const InverseDepthMap> maps, std::uint64_t fingerprint,
                       const WriteBytes& write);

/// Returns the maps of a file, which may hold any bytes. The memory is limited to maps of the sizes
/// of `expected` (whose poses are not read), and some megabytes for zstd. `name`: the file, for
/// messages. Throws Error (bad input) if the file is damaged, of another version, or its
/// fingerprint or map sizes differ.
std::vector<InverseDepthMap> decode_depth_maps(std::span<const std::byte> file,
                                               std::uint64_t fingerprint,
                                               std::span<const VirtualCamera> expected,
                                               std::string_view name);

}  // namespace raystage::render
