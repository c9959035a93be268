// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>

#include "store/take.h"

namespace raystage::store {

/// Returns the archives for a Take whose archives are on other hosts and whose journals are in its
/// folder. A camera without an archive has the records of its journal and frames that cannot be
/// read; other cameras are read as usual. Throws Error (bad input) as Take does for its documents.
std::shared_ptr<const RemoteArchives> make_journal_archives(
    const std::filesystem::path& take_folder);

}  // namespace raystage::store
