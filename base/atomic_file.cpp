// SPDX-License-Identifier: Apache-2.0
#include "base/atomic_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <system_error>
#include <utility>
#include <vector>

#include "base/contained_path.h"
#include "base/error.h"
#include "base/posix_file.h"
#include "base/resources.h"

namespace raystage {
namespace {

constexpr const char* kCheckDisk =
    "Check the folder, its permissions and the free space on the disk";

/// Returns 64 random bits from the kernel. Host name and process ID are not enough: containers and
/// forked processes that write to one folder may share both.
std::uint64_t random_bits(const std::filesystem::path& target) {
  std::uint64_t bits = 0;
  while (true) {
    const ssize_t got = getrandom(&bits, sizeof bits, 0);
    if (got == static_cast<ssize_t>(sizeof bits)) return bits;
    if (got < 0 && errno != EINTR) {
      throw Error::from_errno("no random numbers are available for a temporary file name",
                              target.string(), "Check that the kernel supports getrandom()");
    }
  }
}

std::filesystem::path temporary_beside(const std::filesystem::path& target) {
  const std::string extension = target.extension().string();
  std::string suffix =
      fmt::format(".{}.{}.{:016x}.tmp", host_name(), getpid(), random_bits(target));
  std::ranges::replace(suffix, '/', '_');
  constexpr std::size_t kLongestName = 255;  // bytes, the limit of common file systems
  std::string name = fmt::format(".{}", target.filename().string());
  const std::size_t rest = suffix.size() + extension.size();
  if (name.size() + rest > kLongestName && rest < kLongestName) name.resize(kLongestName - rest);
  return target.parent_path() / (name + suffix + extension);
}

/// Creates a new, empty file next to `target` and returns its path.
std::filesystem::path reserve_temporary_path(const std::filesystem::path& target) {
  constexpr int kMaxTries = 16;  // a second try already needs a collision of 64 random bits
  for (int tries = 1;; ++tries) {
    std::filesystem::path path = temporary_beside(target);
    const FileDescriptor file(
        ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0666));
    if (file.open()) return path;
    if (errno != EEXIST || tries == kMaxTries) {
      throw Error::from_errno("cannot create the file", target.string(), kCheckDisk);
    }
  }
}

/// Renames a flushed file to its final name.
void rename_to_target(const std::filesystem::path& file, const std::filesystem::path& target) {
  if (std::rename(file.c_str(), target.c_str()) != 0) {
    throw Error::from_errno("cannot rename the temporary file to its final name", target.string(),
                            kCheckDisk);
  }
  // The rename survives a power failure only after the folder is flushed. Errors are ignored: not
  // every file system supports it, and the file is complete either way.
  sync_folder(target.parent_path());
}

void write_all(int descriptor, std::span<const std::byte> bytes,
               const std::filesystem::path& target) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(descriptor, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) throw Error::from_errno("cannot write the file", target.string(), kCheckDisk);
    bytes = bytes.subspan(static_cast<std::size_t>(written));
  }
}

/// Returns whether a text begins with the number of a process that has ended, and a dot.
bool has_ended(std::string_view text) {
  pid_t process = 0;
  const auto [rest, error] = std::from_chars(text.data(), text.data() + text.size(), process);
  const bool is_number =
      error == std::errc() && process > 0 && rest != text.data() + text.size() && *rest == '.';
  return is_number && kill(process, 0) != 0 && errno == ESRCH;
}

/// Returns whether a name is .NAME.HOST.PID.RANDOM.tmp.EXT, of any host and process. `begin`:
/// ".NAME.", `end`: ".tmp.EXT".
bool is_temporary_name(std::string_view name, std::string_view begin, std::string_view end) {
  if (!name.starts_with(begin) || !name.ends_with(end)) return false;
  const std::string_view middle =
      name.substr(begin.size(), name.size() - begin.size() - end.size());
  const std::size_t random = middle.rfind('.');
  if (random == std::string_view::npos || random == 0) return false;
  const std::size_t process = middle.rfind('.', random - 1);
  const auto has_only = [](std::string_view part, std::string_view digits) {
    return !part.empty() && part.find_first_not_of(digits) == std::string_view::npos;
  };
  return process != std::string_view::npos && process > 0 &&
         has_only(middle.substr(process + 1, random - process - 1), "0123456789") &&
         has_only(middle.substr(random + 1), "0123456789abcdef");
}

/// Rejects devices and pipes: commit() would replace them by a regular file.
void check_is_no_other_kind(const std::filesystem::path& target) {
  std::error_code unknown;
  const auto there = std::filesystem::status(target, unknown);
  if (std::filesystem::exists(there) && !std::filesystem::is_regular_file(there)) {
    throw Error::failed("the target exists and is not a regular file", target.string(),
                        "Choose the path of a regular file");
  }
}

/// Writes the target through a file that has no name until it is complete: a process that is killed
/// leaves nothing behind. Returns false where the file system does not support it.
bool write_through_unnamed_file(const std::filesystem::path& target,
                                std::span<const std::byte> bytes) {
  const std::filesystem::path folder = target.parent_path();
  FileDescriptor file(
      ::open(folder.empty() ? "." : folder.c_str(), O_TMPFILE | O_WRONLY | O_CLOEXEC, 0666));
  if (!file.open()) return false;
  write_all(file.number(), bytes, target);
  if (fsync(file.number()) != 0) {
    throw Error::from_errno("cannot flush the file to disk", target.string(), kCheckDisk);
  }
  // Only rename() replaces an existing file, and it needs a name.
  const std::string unnamed = fmt::format("/proc/self/fd/{}", file.number());
  const std::filesystem::path named = temporary_beside(target);
  if (::linkat(AT_FDCWD, unnamed.c_str(), AT_FDCWD, named.c_str(), AT_SYMLINK_FOLLOW) != 0) {
    return false;
  }
  try {
    if (!file.close()) {
      throw Error::from_errno("cannot write the file", target.string(), kCheckDisk);
    }
    rename_to_target(named, target);
  } catch (const Error&) {
    std::error_code ignored;
    std::filesystem::remove(named, ignored);
    throw;
  }
  return true;
}

}  // namespace

TemporaryFile::TemporaryFile(std::filesystem::path target, Creation creation)
    : target_(std::move(target)),
      path_(creation == Creation::kByConstructor ? reserve_temporary_path(target_)
                                                 : temporary_beside(target_)) {}

TemporaryFile::~TemporaryFile() {
  if (committed_) return;
  std::error_code ignored;
  std::filesystem::remove(path_, ignored);
}

void TemporaryFile::commit() {
  {
    FileDescriptor file(::open(path_.c_str(), O_RDONLY | O_CLOEXEC));
    if (!file.open()) {
      throw Error::from_errno("cannot write the file", target_.string(), kCheckDisk);
    }
    if (fsync(file.number()) != 0 || !file.close()) {
      throw Error::from_errno("cannot flush the file to disk", target_.string(), kCheckDisk);
    }
  }
  rename_to_target(path_, target_);
  committed_ = true;
}

void remove_abandoned_temporary_files(const std::filesystem::path& target, Owners owners) {
  std::string host = host_name();
  std::ranges::replace(host, '/', '_');
  const std::string of_target = fmt::format(".{}.", target.filename().string());
  const std::string begin = of_target + host + ".";
  const std::string end = ".tmp" + target.extension().string();
  const auto is_abandoned = [&](const std::string& name) {
    if (name.size() < of_target.size() + end.size() || !name.ends_with(end)) return false;
    if (owners == Owners::kAll) return is_temporary_name(name, of_target, end);
    return name.size() >= begin.size() + end.size() && name.starts_with(begin) &&
           has_ended(std::string_view(name).substr(begin.size()));
  };
  std::error_code error;
  std::vector<std::filesystem::path> abandoned;
  for (std::filesystem::directory_iterator entry(target.parent_path(), error), last;
       !error && entry != last; entry.increment(error)) {
    if (is_abandoned(entry->path().filename().string()) &&
        entry->symlink_status(error).type() == std::filesystem::file_type::regular) {
      abandoned.push_back(entry->path());
    }
  }
  for (const std::filesystem::path& file : abandoned) std::filesystem::remove(file, error);
}

void check_writable(const std::filesystem::path& target) {
  check_is_no_other_kind(target);
  const TemporaryFile temporary(target);
}

void write_file_atomically(const std::filesystem::path& target, std::span<const std::byte> bytes) {
  check_is_no_other_kind(target);
  if (write_through_unnamed_file(target, bytes)) return;
  TemporaryFile temporary(target);
  {
    FileDescriptor file(::open(temporary.path().c_str(), O_WRONLY | O_NOFOLLOW | O_CLOEXEC));
    if (!file.open()) {
      throw Error::from_errno("cannot create the file", target.string(), kCheckDisk);
    }
    write_all(file.number(), bytes, target);
    if (!file.close()) {
      throw Error::from_errno("cannot write the file", target.string(), kCheckDisk);
    }
  }
  temporary.commit();
}

void write_file_atomically(const std::filesystem::path& target, std::string_view text) {
  write_file_atomically(target, std::as_bytes(std::span(text.data(), text.size())));
}

bool file_exists(const std::filesystem::path& path) {
  std::error_code ignored;
  return std::filesystem::exists(path, ignored);
}

bool is_folder(const std::filesystem::path& path) {
  std::error_code ignored;
  return std::filesystem::is_directory(path, ignored);
}

bool is_name_taken(const std::filesystem::path& path) {
  std::error_code ignored;
  return std::filesystem::exists(std::filesystem::symlink_status(path, ignored));
}

namespace {

Error file_not_readable(const std::filesystem::path& file, std::string_view reason) {
  return Error::bad_input("the file cannot be read: " + std::string(reason), file.string(),
                          "Check the path and its permissions");
}

std::string errno_text() { return std::generic_category().message(errno); }

/// Reads an opened file, or a pipe until its end. `file`: for errors.
std::string read_descriptor(const FileDescriptor& descriptor, const std::filesystem::path& file,
                            bool may_be_pipe, std::uint64_t max_bytes) {
  const auto refuse = [&](std::string_view reason) { return file_not_readable(file, reason); };
  struct stat status {};
  if (fstat(descriptor.number(), &status) != 0) throw refuse(errno_text());
  if (S_ISDIR(status.st_mode)) throw refuse("it is a folder");
  if (S_ISFIFO(status.st_mode) && !may_be_pipe) throw refuse("it is a pipe");
  if (!S_ISREG(status.st_mode) && !S_ISFIFO(status.st_mode)) throw refuse("it is a device");
  const auto too_large = [&] {
    return Error::bad_input(
        fmt::format("the file has more than {:.0f} MB, the limit for such files",
                    static_cast<double>(max_bytes) * 1e-6),
        file.string(), "Give a smaller file");
  };
  if (static_cast<std::uint64_t>(status.st_size) > max_bytes) throw too_large();

  // The size is a hint: pipes and /proc report 0. One extra byte lets the last read find the end.
  std::string text(static_cast<std::size_t>(status.st_size) + 1, '\0');
  std::size_t filled = 0;
  while (true) {
    if (filled > max_bytes) throw too_large();
    if (filled == text.size()) text.resize(text.size() * 2 + 4096);
    const ssize_t got = ::read(descriptor.number(), text.data() + filled, text.size() - filled);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0 && errno == EAGAIN) {
      constexpr int kSilentMilliseconds = 10'000;
      pollfd waiting{descriptor.number(), POLLIN, 0};
      if (poll(&waiting, 1, kSilentMilliseconds) == 0) throw refuse("nothing arrives in the pipe");
      continue;
    }
    if (got < 0) throw refuse(errno_text());
    if (got == 0) break;
    filled += static_cast<std::size_t>(got);
  }
  text.resize(filled);
  return text;
}

}  // namespace

std::string read_file(const std::filesystem::path& file, std::uint64_t max_bytes) {
  // A named pipe without a writer does not block then.
  const FileDescriptor opened(::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  if (!opened.open()) throw file_not_readable(file, errno_text());
  return read_descriptor(opened, file, true, max_bytes);
}

std::string read_file(const ContainedPath& file, std::uint64_t max_bytes) {
  const FileDescriptor opened = open_contained_to_read(file);
  if (!opened.open()) throw contained_open_error(file, errno);
  return read_descriptor(opened, file.path(), false, max_bytes);
}

void create_folder(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (!error && !std::filesystem::is_directory(folder, error) && !error) {
    error = std::make_error_code(std::errc::not_a_directory);
  }
  if (error) {
    throw Error::failed("cannot create the folder: " + error.message(), folder.string(),
                        kCheckDisk);
  }
}

}  // namespace raystage
