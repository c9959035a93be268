// SPDX-License-Identifier: Apache-2.0
#include "base/mapped_file.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <system_error>
#include <utility>

#include "base/contained_path.h"
#include "base/error.h"

namespace raystage {
namespace {

/// Calls madvise() for the pages that contain `part`.
int advise(std::span<const std::byte> part, int advice) {
  static const auto page = static_cast<std::uintptr_t>(sysconf(_SC_PAGESIZE));
  const auto first = reinterpret_cast<std::uintptr_t>(part.data()) / page * page;
  const auto last = reinterpret_cast<std::uintptr_t>(part.data() + part.size());
  return madvise(reinterpret_cast<void*>(first), last - first, advice);
}

}  // namespace

MappedFile::MappedFile(const std::filesystem::path& path) : MappedFile(InputFile(path), path) {}

MappedFile::MappedFile(const ContainedPath& path) : MappedFile(InputFile(path), path.path()) {}

MappedFile::MappedFile(const InputFile& file, std::filesystem::path name)
    : name_(std::move(name)),
      file_(fcntl(file.file_.number(), F_DUPFD_CLOEXEC, 0)),
      pages_(file_, file.size(), name_),
      range_(pages_.bytes) {}

MappedFile::Pages::Pages(const FileDescriptor& file, std::uint64_t size,
                         const std::filesystem::path& name) {
  if (size == 0) return;
  void* address = MAP_FAILED;
  if (file.open()) address = mmap(nullptr, size, PROT_READ, MAP_SHARED, file.number(), 0);
  if (address == MAP_FAILED) {
    throw Error::bad_input("the file cannot be read: " + std::generic_category().message(errno),
                           name.string(), "Check that it exists and is readable");
  }
  bytes = {static_cast<const std::byte*>(address), static_cast<std::size_t>(size)};
}

MappedFile::Pages::~Pages() {
  if (!bytes.empty()) munmap(const_cast<std::byte*>(bytes.data()), bytes.size());
}

void MappedFile::expect(Access access) const {
  if (bytes().empty()) return;
  madvise(const_cast<std::byte*>(bytes().data()), bytes().size(),
          access == Access::kSequential ? MADV_SEQUENTIAL : MADV_RANDOM);
}

bool MappedFile::can_read(std::span<const std::byte> part) const {
  if (part.empty()) return true;
  // Older kernels do not support the request; the part is then assumed to be readable.
  return advise(part, MADV_POPULATE_READ) == 0 ||
         (errno != EFAULT && errno != EIO && errno != EHWPOISON);
}

bool MappedFile::is_mostly_cached() const {
  constexpr std::size_t kSamples = 64;
  const auto page = static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
  struct stat status {};
  // The kernel states pages of other owners' files as cached, whether they are or not.
  if (bytes().empty() || fstat(file_.number(), &status) != 0 || status.st_uid != geteuid())
    return false;
  const std::size_t pages = (bytes().size() + page - 1) / page;
  const std::size_t samples = std::min(kSamples, pages);
  std::size_t cached = 0;
  for (std::size_t i = 0; i < samples; ++i) {
    unsigned char state = 0;
    auto* const address = const_cast<std::byte*>(bytes().data()) + i * pages / samples * page;
    cached += mincore(address, 1, &state) == 0 && (state & 1U) != 0 ? 1 : 0;
  }
  return 2 * cached > samples;
}

void MappedFile::uncache(std::span<const std::byte> part) const {
  if (part.empty()) return;
  advise(part, MADV_DONTNEED);  // the kernel keeps pages that are mapped
  posix_fadvise(file_.number(), part.data() - bytes().data(), static_cast<off_t>(part.size()),
                POSIX_FADV_DONTNEED);
}

void MappedFile::check_read() const {
  struct stat now {};
  const bool is_shorter =
      fstat(file_.number(), &now) == 0 && static_cast<std::uint64_t>(now.st_size) < bytes().size();
  if (is_shorter) {
    throw Error::failed("another program truncated the file while it was read", name_.string(),
                        "Restore the file from a copy, and run `raystage verify` on the take");
  }
  if (range_.has_unread_pages()) {
    throw Error::failed("the disk cannot read all of the file", name_.string(),
                        "Check the disk, and run `raystage verify` on the take");
  }
}

}  // namespace raystage
