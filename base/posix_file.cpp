// SPDX-License-Identifier: Apache-2.0
#include "base/posix_file.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <climits>
#include <system_error>
#include <utility>
#include <vector>

#include "base/contained_path.h"
#include "base/error.h"

namespace raystage {
namespace {

// iovec has no const pointer, although writev only reads.
iovec part(std::span<const std::byte> bytes) {
  return {const_cast<std::byte*>(bytes.data()), bytes.size()};
}

Error not_readable(const std::filesystem::path& path, int reason) {
  return Error::bad_input("the file cannot be read: " + std::generic_category().message(reason),
                          path.string(), "Check that it exists and is readable");
}

/// Opens a file for reading; a named pipe does not block then.
int open_to_read(const std::filesystem::path& path) {
  return open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
}

std::size_t read_up_to(const FileDescriptor& file, std::uint64_t offset,
                       std::span<std::byte> bytes) {
  std::size_t filled = 0;
  while (filled < bytes.size()) {
    const ssize_t got = pread(file.number(), bytes.data() + filled, bytes.size() - filled,
                              static_cast<off_t>(offset + filled));
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) break;
    filled += static_cast<std::size_t>(got);
  }
  return filled;
}

std::size_t read_regular_part(const FileDescriptor& file, std::uint64_t offset,
                              std::span<std::byte> bytes) {
  struct stat status {};
  if (!file.open() || fstat(file.number(), &status) != 0 || !S_ISREG(status.st_mode)) return 0;
  return read_up_to(file, offset, bytes);
}

}  // namespace

void raise_open_file_limit() {
  rlimit limit{};
  if (getrlimit(RLIMIT_NOFILE, &limit) != 0) return;
  limit.rlim_cur = limit.rlim_max;
  setrlimit(RLIMIT_NOFILE, &limit);  // otherwise the former limit stays
}

FileDescriptor::~FileDescriptor() {
  if (number_ >= 0) ::close(number_);
}

bool FileDescriptor::close() { return ::close(std::exchange(number_, -1)) == 0; }

OutputFile::OutputFile(std::filesystem::path path, Open mode)
    : path_(std::move(path)),
      // A named pipe does not block. Permissions: minus the user's umask.
      file_(open(path_.c_str(),
                 O_WRONLY | O_CLOEXEC | O_NONBLOCK | (mode == Open::kNew ? O_CREAT | O_EXCL : 0),
                 0666)) {
  if (!file_.open()) {
    throw mode == Open::kNew
        ? Error::from_errno("the file cannot be created", path_.string(),
                            "Choose a new file name in a writable folder")
        : Error::from_errno("the file cannot be opened for writing", path_.string(),
                            "Check that it exists and is writable");
  }
  lock();
}

OutputFile::OutputFile(const ContainedPath& existing)
    : path_(existing.path()), file_(open_contained(existing, O_WRONLY)) {
  if (!file_.open()) {
    if (errno == ELOOP || errno == EXDEV) require_contained(existing);
    throw Error::from_errno("the file cannot be opened for writing", path_.string(),
                            "Check that it exists and is writable");
  }
  lock();
}

void OutputFile::lock() {
  struct stat status {};
  if (fstat(file_.number(), &status) != 0 || !S_ISREG(status.st_mode)) {
    throw Error::failed("this is no regular file", path_.string(), "Restore the file");
  }
  // The kernel releases the lock when the process ends, however it ends.
  is_locked_ = flock(file_.number(), LOCK_EX | LOCK_NB) == 0;
  if (!is_locked_ && errno == EWOULDBLOCK) {
    throw Error::failed("another program is writing to the file", path_.string(),
                        "Wait until the recording has ended");
  }
}

OutputFile::~OutputFile() = default;

bool OutputFile::write_at(std::uint64_t offset, std::span<const std::byte> bytes) {
  return write_parts_at(offset, std::span(&bytes, 1));
}

bool OutputFile::write_parts_at(std::uint64_t offset,
                                std::span<const std::span<const std::byte>> parts) {
  std::vector<iovec> left;
  for (const auto& bytes : parts) {
    if (!bytes.empty()) left.push_back(part(bytes));
  }
  for (std::size_t first = 0; first < left.size();) {
    const auto count = static_cast<int>(std::min<std::size_t>(left.size() - first, IOV_MAX));
    const ssize_t written =
        pwritev(file_.number(), &left[first], count, static_cast<off_t>(offset));
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) {
      if (written == 0) errno = ENOSPC;
      return false;
    }
    offset += static_cast<std::uint64_t>(written);
    auto done = static_cast<std::size_t>(written);
    for (; first < left.size() && done >= left[first].iov_len; ++first) {
      done -= left[first].iov_len;
    }
    if (done > 0) {
      left[first].iov_base = static_cast<std::byte*>(left[first].iov_base) + done;
      left[first].iov_len -= done;
    }
  }
  return true;
}

bool OutputFile::truncate(std::uint64_t size) {
  return ftruncate(file_.number(), static_cast<off_t>(size)) == 0;
}

bool OutputFile::sync() const { return fdatasync(file_.number()) == 0; }

void OutputFile::uncache() const { posix_fadvise(file_.number(), 0, 0, POSIX_FADV_DONTNEED); }

void OutputFile::discard() {
  file_.close();
  unlink(path_.c_str());
}

std::size_t read_file_part(const std::filesystem::path& file, std::uint64_t offset,
                           std::span<std::byte> bytes) {
  return read_regular_part(FileDescriptor(open_to_read(file)), offset, bytes);
}

std::size_t read_file_part(const ContainedPath& file, std::uint64_t offset,
                           std::span<std::byte> bytes) {
  return read_regular_part(open_contained_to_read(file), offset, bytes);
}

InputFile::InputFile(const std::filesystem::path& path) : file_(open_to_read(path)) {
  if (!file_.open()) throw not_readable(path, errno);
  require_regular(path);
}

InputFile::InputFile(const ContainedPath& path) : file_(open_contained_to_read(path)) {
  if (!file_.open()) throw contained_open_error(path, errno);
  require_regular(path.path());
}

void InputFile::require_regular(const std::filesystem::path& path) {
  struct stat status {};
  if (fstat(file_.number(), &status) != 0) throw not_readable(path, errno);
  if (!S_ISREG(status.st_mode)) {
    throw Error::bad_input("the file is not a regular one", path.string(), "Restore the file");
  }
  size_ = static_cast<std::uint64_t>(status.st_size);
}

std::size_t InputFile::read_at(std::uint64_t offset, std::span<std::byte> bytes) const {
  return read_up_to(file_, offset, bytes);
}

void InputFile::read_ahead(std::uint64_t offset, std::uint64_t size) const {
  posix_fadvise(file_.number(), static_cast<off_t>(offset), static_cast<off_t>(size),
                POSIX_FADV_WILLNEED);
}

void sync_folder(const std::filesystem::path& folder) {
  const FileDescriptor file(
      open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (file.open()) fsync(file.number());
}

void sync_files_below(const std::filesystem::path& folder) {
  const auto for_each_file = [&](auto&& act) {
    std::error_code error, unknown;
    // Not a range-based for: its increment would throw.
    for (std::filesystem::recursive_directory_iterator entry(folder, error), end;
         !error && entry != end; entry.increment(error)) {
      const bool is_folder = entry->is_directory(unknown);
      if (!is_folder && !entry->is_regular_file(unknown)) continue;
      const FileDescriptor file(open(entry->path().c_str(), O_RDONLY | O_CLOEXEC));
      if (!file.open() || !act(file.number(), is_folder)) {
        throw Error::from_errno("the data cannot be flushed to disk", entry->path().string(),
                                "Check the disk for errors and free space");
      }
    }
    if (error) {
      throw Error::failed("the folder cannot be read: " + error.message(), folder.string(),
                          "Check its permissions and the disk");
    }
  };
  for_each_file([](int descriptor, bool is_folder) {
    // A hint: file systems that ignore it write in the second pass.
    if (!is_folder) sync_file_range(descriptor, 0, 0, SYNC_FILE_RANGE_WRITE);
    return true;
  });
  for_each_file([](int descriptor, bool is_folder) {
    return fsync(descriptor) == 0 || (is_folder && errno == EINVAL);
  });
}

}  // namespace raystage
