// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "store/fixity/verify_archive.h"

namespace raystage::store {

/// Adds the name r0c0.mkv.damaged (later .damaged-2 and so on) to a file and returns it. Throws
/// Error (failed) if that is not possible.
std::string keep_original(const std::filesystem::path& file);

struct PairFiles {
  std::filesystem::path archive, journal;
};
/// Replaces an archive and its journal by what `write` writes to the two paths that it receives.
/// The new files are verified, must hold `frames` frames, and are renamed over the originals, which
/// may be missing. `expected`: describes and names the pair; its bytes are ignored. Returns the new
/// names of the originals with `keep_originals`. Throws Error (failed) if the disk fails; the
/// originals then have their names.
std::vector<std::string> replace_pair(
    ArchivePair expected, const PairFiles& files, std::int64_t frames, bool keep_originals,
    const std::function<void(const std::filesystem::path& archive,
                             const std::filesystem::path& journal)>& write);

}  // namespace raystage::store
