// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>

#include "store/take.h"

namespace raystage {

/// For a Take whose archives are on other hosts, with their journals in its folder: a camera
/// without an archive has the records of its journal, and frames that cannot be read. Cameras with
/// an archive are read as ever. Throws Error (bad input) as Take does for its documents.
std::shared_ptr<const RemoteArchives> journals_for_archives(
    const std::filesystem::path& take_folder);

}  // namespace raystage
