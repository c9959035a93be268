// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>

namespace raystage::store {

/// Returns the number of records in a journal, without the frames that only a scan of the archive
/// finds. Throws Error as ArchiveReader.
std::size_t count_listed_records(const std::filesystem::path& archive,
                                 const std::filesystem::path& journal);

/// Cuts off the whole frames at the end of an archive that its journal lacks: a crash came between
/// the two. No append() of them had returned. Throws Error as ArchiveReader, and Error (failed) if
/// the archive is open for writing elsewhere or the disk fails.
void discard_unlisted_frames(const std::filesystem::path& archive,
                             const std::filesystem::path& journal);

}  // namespace raystage::store
