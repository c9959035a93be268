// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include "store/archive.h"

namespace raystage::store {

/// Throws Error (bad input) unless the archive is closed and holds exactly what its journal lists.
void require_whole_archive(const ArchiveReader& archive, const std::string& camera_id,
                           const std::filesystem::path& take_folder);

}  // namespace raystage::store
