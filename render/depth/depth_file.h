// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "render/depth/camera_depths.h"

namespace raystage {

/// What an instant's depths stand on: XXH3 over the version of the algorithm, the settings, the
/// rig, and for each camera its frame's JPEG bytes or that it has none.
std::uint64_t depth_fingerprint(const Instant& instant, const DepthSettings& settings);

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

/// Where a take keeps them: TAKE/depth/FINGERPRINT.zst.
std::filesystem::path depth_file(const std::filesystem::path& take_folder,
                                 std::uint64_t fingerprint);

/// The instant's depths: those kept in the take's folder if they are whole and fit, else found anew
/// and kept there. What hinders the keeping (a read-only take, a full disk) is no error but told in
/// `note`, for people.
CameraDepths kept_camera_depths(const Instant& instant, const DepthSettings& settings,
                                std::size_t working_bytes, bool keep, std::string& note);

}  // namespace raystage
