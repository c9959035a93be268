// SPDX-License-Identifier: Apache-2.0
#include "base/temporary_folder.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <csignal>
#include <cstdio>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "base/atomic_file.h"
#include "base/error.h"
#include "base/resources.h"

namespace raystage {
namespace {

namespace fs = std::filesystem;

/// ".NAME.HOST."
std::string name_begin(const fs::path& target) {
  std::string host = host_name();
  std::ranges::replace(host, '/', '_');
  return fmt::format(".{}.{}.", target.filename().string(), host);
}

/// Returns whether a name is `begin` PID.RANDOM.tmp, of a process that has ended.
bool is_of_ended_process(std::string_view name, std::string_view begin) {
  constexpr std::string_view kEnd = ".tmp";
  if (!name.starts_with(begin) || !name.ends_with(kEnd)) return false;
  name.remove_prefix(begin.size());
  if (name.size() <= kEnd.size()) return false;
  name.remove_suffix(kEnd.size());
  pid_t process = 0;
  const char* const end = name.data() + name.size();
  const auto [rest, error] = std::from_chars(name.data(), end, process);
  if (error != std::errc() || process <= 0 || rest == end || *rest != '.') return false;
  const std::string_view random(rest + 1, static_cast<std::size_t>(end - rest - 1));
  if (random.empty() || random.find_first_not_of("0123456789abcdef") != random.npos) return false;
  return kill(process, 0) != 0 && errno == ESRCH;
}

int open_folder_itself(const fs::path& folder) {
  return ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
}

/// Returns false if somebody else holds the lock. Not every file system has locks: then only the
/// numbers of processes count.
bool lock_folder(const FileDescriptor& folder) {
  return flock(folder.number(), LOCK_EX | LOCK_NB) == 0 || errno != EWOULDBLOCK;
}

/// Returns whether the path is still the folder that was opened.
bool is_same_folder(const FileDescriptor& folder, const fs::path& path) {
  struct stat opened {
  }, named{};
  return fstat(folder.number(), &opened) == 0 && lstat(path.c_str(), &named) == 0 &&
         opened.st_dev == named.st_dev && opened.st_ino == named.st_ino;
}

/// A process whose number has ended may still live in another container, so that the lock counts,
/// too. Faults are ignored: what cannot be removed takes space only.
void remove_abandoned_folders(const fs::path& target) {
  const std::string begin = name_begin(target);
  std::error_code error;
  std::vector<fs::path> abandoned;
  for (fs::directory_iterator entry(target.parent_path(), error), last; !error && entry != last;
       entry.increment(error)) {
    if (is_of_ended_process(entry->path().filename().string(), begin)) {
      abandoned.push_back(entry->path());
    }
  }
  for (const fs::path& folder : abandoned) {
    const FileDescriptor opened(open_folder_itself(folder));
    if (opened.open() && lock_folder(opened)) fs::remove_all(folder, error);
  }
}

fs::path random_path(const fs::path& target) {
  std::random_device random;
  const auto bits = (std::uint64_t{random()} << 32) | random();
  const std::string suffix = fmt::format("{}.{:016x}.tmp", getpid(), bits);
  std::string begin = name_begin(target);
  constexpr std::size_t kLongestName = 255;  // bytes, the limit of common file systems
  if (begin.size() + suffix.size() > kLongestName) begin.resize(kLongestName - suffix.size());
  return target.parent_path() / (begin + suffix);
}

}  // namespace

fs::path path_with_name(const fs::path& folder) {
  fs::path path = fs::absolute(folder).lexically_normal();
  return path.has_filename() ? path : path.parent_path();
}

TemporaryFolder::TemporaryFolder(const fs::path& target) : target_(path_with_name(target)) {
  try {
    create_folder(target_.parent_path());
    remove_abandoned_folders(target_);
    // Another process that removes abandoned folders may come between creation and lock.
    constexpr int kMaxTries = 16;
    bool is_locked = false;
    for (int tries = 0; !is_locked && tries < kMaxTries; ++tries) {
      path_ = random_path(target_);
      create_folder(path_);
      lock_.emplace(open_folder_itself(path_));
      is_locked = lock_->open() && lock_folder(*lock_) && is_same_folder(*lock_, path_);
    }
    if (!is_locked) {
      throw Error::from_errno("the folder cannot be opened", path_.string(),
                              "Check the permissions of its parent folder");
    }
  } catch (const Error& error) {
    throw Error::failed(error.what_happened(), target_.string(), error.what_to_do());
  }
}

TemporaryFolder::~TemporaryFolder() {
  if (committed_) return;
  std::error_code ignored;
  fs::remove_all(path_, ignored);
}

bool TemporaryFolder::commit() {
  sync_files_below(path_);
  if (renameat2(AT_FDCWD, path_.c_str(), AT_FDCWD, target_.c_str(), RENAME_NOREPLACE) != 0) {
    if (errno != EINVAL && errno != ENOSYS) return false;
    // Not every file system supports the flag; otherwise at worst an empty folder is replaced.
    if (is_name_taken(target_)) {
      errno = EEXIST;
      return false;
    }
    if (std::rename(path_.c_str(), target_.c_str()) != 0) return false;
  }
  committed_ = true;
  sync_folder(target_.parent_path());
  return true;
}

}  // namespace raystage
