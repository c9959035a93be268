// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

namespace raystage::store {

enum class Direction { kPack, kUnpack };

/// Copies the files of a take that are no archive or journal to another form of the take, whose
/// archives and documents are written already. take.json and rig.json are copied byte for byte if
/// the new take's say the same about its archives. The manifest of the unpacked form is kept in
/// original/ of the packed one. Throws Error as files_of_take(), and Error (failed) if the disk
/// fails.
void copy_other_files(const std::filesystem::path& from, const std::filesystem::path& to,
                      Direction direction);

}  // namespace raystage::store
