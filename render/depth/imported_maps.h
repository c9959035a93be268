// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "render/depth/inverse_depth_map.h"
#include "schemas/imported_depths_document.h"
#include "store/take.h"

namespace raystage::render {

/// The largest imported map, pixels.
inline constexpr std::size_t kMaxImportedPixels = std::size_t{1} << 26;

/// Returns the XXH3-64 of a frame's JPEG as it was recorded, as ImportedDepthsDocument::Map states
/// it: packing does not change it.
std::string imported_frame_xxh3(const store::Take& take, int camera, int frame);

/// Returns the bytes of the file of an imported map, an inverse depth or distance in the pixels of
/// the recorded picture. `frame_xxh3`: of the frame to which it belongs.
std::vector<std::byte> encode_imported_map(const InverseDepthMap& map,
                                           const std::string& frame_xxh3);
/// Returns the map of a frame, or null if there is none. A map belongs to the frame whose JPEG it
/// states, also if a repair has given the frame another number. If the map of this number is of
/// another frame for no such reason, it is returned, and reading it throws.
const schemas::ImportedDepthsDocument::Map* find_imported_map(
    const schemas::ImportedDepthsDocument& document, const store::Take& take, int camera,
    int frame);
/// Returns an imported map of a frame. Throws Error (bad input) if the file is missing or damaged,
/// or if it belongs to another frame.
InverseDepthMap read_imported_map(const store::Take& take, int camera, int frame,
                                  const schemas::ImportedDepthsDocument::Map& map);

}  // namespace raystage::render
