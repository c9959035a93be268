// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "render/depth/pinhole.h"

namespace raystage {

/// Depths as a file keeps them: multiples of a power of two, 65534 at most. Solved depths are
/// brought to these, so that a view does not depend on whether they were found or read.
void quantise(InverseDepthMap& map);

/// The file's bytes; layout in docs/formats/depth.md. Maps as quantise() leaves them are kept to
/// the bit.
std::vector<std::byte> encode_depth_maps(std::span<const InverseDepthMap> maps,
                                         std::uint64_t fingerprint);

/// Reads any bytes; no more memory is taken than maps of the sizes of `expected` (whose values are
/// not looked at) need. Throws Error (bad input): damaged, of another version, with another
/// fingerprint, of maps of other sizes.
std::vector<InverseDepthMap> decode_depth_maps(std::span<const std::byte> file,
                                               std::uint64_t fingerprint,
                                               std::span<const VirtualCamera> expected,
                                               std::string_view name);

}  // namespace raystage
