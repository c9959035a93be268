// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "store/take.h"

namespace raystage::store {

/// Returns the archives for a Take of which some were lost and this is accepted: a camera without
/// an archive has no frames (Take::is_missing()); other cameras are read as usual. Null if `folder`
/// has no take.json, which Take reports. Throws Error (bad input) as Take does for its documents,
/// and if all archives are missing.
std::shared_ptr<const RemoteArchives> make_absent_archives(
    const std::filesystem::path& take_folder);

/// Returns a sentence that names the cameras without archives; empty if there are none.
std::string describe_missing_archives(const Take& take);

}  // namespace raystage::store
