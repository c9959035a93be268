// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <vector>

#include "base/contained_path.h"
#include "schemas/imported_depths_document.h"
#include "store/take.h"

namespace raystage::store {

/// Returns what a take states of its imported depth maps (docs/formats/depth.md); empty if it has
/// none. Throws Error (bad input) if the document is damaged, or missing although there are maps.
schemas::ImportedDepthsDocument read_imported_depths(const Take& take);

/// Returns the files of depth maps in the cameras' folders of imported depths, listed or not; no
/// links. Temporary files of a running import are among them.
std::vector<ContainedPath> imported_map_files(const Take& take);

/// Returns whether the file of an imported map has the XXH3-64 that its name states.
/// `before_read`: is called with the number of its bytes, unless null. Throws Error (bad input) if
/// the file is missing, is no regular file or cannot be read.
bool has_stated_hash(const ContainedPath& map_file,
                     const std::function<void(std::uint64_t)>& before_read = {});

}  // namespace raystage::store
