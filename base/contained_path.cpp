// SPDX-License-Identifier: Apache-2.0
#include "base/contained_path.h"

#include <fcntl.h>
#include <linux/openat2.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <string_view>
#include <system_error>

#include "base/error.h"

namespace raystage {
namespace {

constexpr int kFolder = O_PATH | O_DIRECTORY | O_CLOEXEC;

int with_defaults(int flags) { return flags | O_CLOEXEC | (flags & O_PATH ? 0 : O_NONBLOCK); }

bool leaves_folder(const std::filesystem::path& relative) {
  const std::filesystem::path plain = relative.lexically_normal();
  return plain.is_absolute() || plain.empty() || *plain.begin() == "..";
}

int open_folder(const std::filesystem::path& folder) {
  return open(folder.empty() ? "." : folder.c_str(), kFolder);
}

/// Opens by O_RDONLY or O_PATH, through links if they are permitted.
FileDescriptor open_to_see(const ContainedPath& file, int flags) {
  if (!permits_links()) return open_contained(file, flags);
  if (leaves_folder(file.relative)) {
    errno = EXDEV;
    return FileDescriptor(-1);
  }
  return FileDescriptor(open(file.path().c_str(), with_defaults(flags)));
}

}  // namespace

FileDescriptor open_contained(const ContainedPath& file, int flags, mode_t mode) {
  if (file.relative.empty() || file.relative.is_absolute()) {
    errno = EXDEV;
    return FileDescriptor(-1);
  }
  const FileDescriptor folder(open_folder(file.folder));
  if (!folder.open()) return FileDescriptor(-1);
  flags = with_defaults(flags);
  open_how how{};
  how.flags = static_cast<std::uint64_t>(flags);
  how.mode = (flags & O_CREAT) != 0 ? mode : 0;
  how.resolve = RESOLVE_BENEATH | RESOLVE_NO_SYMLINKS | RESOLVE_NO_MAGICLINKS;
  const long opened =
      syscall(SYS_openat2, folder.number(), file.relative.c_str(), &how, sizeof how);
  if (opened >= 0 || (errno != ENOSYS && errno != EPERM)) {
    return FileDescriptor(static_cast<int>(opened));
  }
  return open_contained_by_parts(file, flags, mode);
}

FileDescriptor open_contained_by_parts(const ContainedPath& file, int flags, mode_t mode) {
  const auto fail = [](int reason) {
    errno = reason;
    return FileDescriptor(-1);
  };
  if (file.relative.empty() || file.relative.is_absolute()) return fail(EXDEV);
  int parent = open_folder(file.folder);
  for (auto part = file.relative.begin(); part != file.relative.end();) {
    if (parent < 0) break;
    const FileDescriptor folder(parent);
    if (*part == "..") return fail(EXDEV);
    const std::filesystem::path name = *part++;
    struct stat status {};
    const bool is_there = fstatat(parent, name.c_str(), &status, AT_SYMLINK_NOFOLLOW) == 0;
    if (is_there && S_ISLNK(status.st_mode)) return fail(ELOOP);
    const bool is_last = part == file.relative.end();
    // A link that replaces the part in between is refused, too.
    parent = openat(folder.number(), name.c_str(),
                    (is_last ? with_defaults(flags) : kFolder) | O_NOFOLLOW, mode);
  }
  return FileDescriptor(parent);
}

bool permits_links() {
  const char* const value = std::getenv(kFollowLinksVariable);  // NOLINT(concurrency-mt-unsafe)
  return value != nullptr && std::string_view(value) == "1";
}

FileDescriptor open_contained_to_read(const ContainedPath& file) {
  return open_to_see(file, O_RDONLY);
}

bool exists(const ContainedPath& file) {
  if (open_to_see(file, O_PATH).open()) return true;
  if (errno == ENOENT || errno == ENOTDIR) return false;
  throw contained_open_error(file, errno);
}

Error contained_open_error(const ContainedPath& file, int reason) {
  if (reason == EXDEV) {
    return Error::bad_input("the path leaves its folder", file.path().string(),
                            "Give a path below " + file.folder.string());
  }
  if (reason == ELOOP) {
    return Error::bad_input("a part of the path is a link, which could lead anywhere",
                            file.path().string(),
                            "Replace the link by the file or folder itself; for links that you "
                            "trust, commands that only read have --follow-links");
  }
  return Error::bad_input("the file cannot be read: " + std::generic_category().message(reason),
                          file.path().string(), "Check that it exists and is readable");
}

void require_contained(const ContainedPath& file) {
  const bool leaves = leaves_folder(file.relative);
  if (!leaves && open_contained(file, O_PATH).open()) return;
  if (leaves || errno == EXDEV) throw contained_open_error(file, EXDEV);
  if (errno == ELOOP) {
    throw Error::bad_input("a part of the path is a link, which could lead anywhere",
                           file.path().string(), "Replace the link by the file or folder itself");
  }
  if (errno == ENOENT || errno == ENOTDIR) return;
  throw Error::from_errno("the path cannot be checked for links", file.path().string(),
                          "Check its permissions and the limit of open files");
}

bool is_contained(const ContainedPath& file) {
  try {
    require_contained(file);
    return true;
  } catch (const Error&) {
    return false;
  }
}

}  // namespace raystage
