// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/types.h>

#include <filesystem>

#include "base/error.h"
#include "base/posix_file.h"

namespace raystage {

/// A path below a folder that somebody else may have made, such as a take. Links in it are not
/// followed, because they could lead to any file of this machine, unless the user permits it for
/// reading.
struct ContainedPath {
  std::filesystem::path folder;    ///< may itself be a link
  std::filesystem::path relative;  ///< of a file or folder below it

  std::filesystem::path path() const { return folder / relative; }
};

/// Opens a file or folder by open(2)'s `flags`; O_CLOEXEC and O_NONBLOCK are added, so that a named
/// pipe does not block. Fails with ELOOP if a part of the relative path is a link, and with EXDEV
/// if it leaves the folder.
FileDescriptor open_contained(const ContainedPath& file, int flags, mode_t mode = 0);

/// The same for kernels before 5.6 and sandboxes that do not know openat2(): part by part.
FileDescriptor open_contained_by_parts(const ContainedPath& file, int flags, mode_t mode = 0);

/// Set to 1, this environment variable permits links below folders, for reading only: archives may
/// then be on other disks.
inline constexpr const char* kFollowLinksVariable = "RAYSTAGE_FOLLOW_LINKS";

/// Returns whether kFollowLinksVariable is 1.
bool permits_links();

/// Opens a file for reading as open_contained() does, or through links if kFollowLinksVariable
/// is 1.
FileDescriptor open_contained_to_read(const ContainedPath& file);

/// Returns the error for a failure of the functions above; `reason` is its errno.
Error contained_open_error(const ContainedPath& file, int reason);

/// Returns whether there is a file or folder that open_contained_to_read() might open. Throws Error
/// (bad input) that names it if that cannot be determined: behind a link, in a folder that may not
/// be searched, or of too long a name.
bool exists(const ContainedPath& file);

/// Throws Error (bad input) if the path leaves its folder, or if a part of it is a link, and Error
/// (failed) if that cannot be determined. What does not exist is no link. Call it before writing or
/// deleting by name; it does not protect from somebody who changes the folder at the same time.
void require_contained(const ContainedPath& file);
/// Returns whether require_contained() throws nothing.
bool is_contained(const ContainedPath& file);

}  // namespace raystage
