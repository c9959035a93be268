// SPDX-License-Identifier: Apache-2.0
// Simulates disk faults in a folder when it is preloaded into a command (LD_PRELOAD):
//   BAD_DISK_FOLDER=/path   the folder
//   BAD_DISK="FAULT[;FAULT...]" of
//     ENOSPC|EDQUOT|EROFS|EIO FROM SECONDS   writes fail for SECONDS after the first FROM bytes
//     ESTALE FROM SECONDS             no file can be opened for reading
//     SYNC FROM SECONDS               fdatasync and fsync fail with EIO
//     STALL FROM SECONDS              writes and syncs wait until the fault ends
//     SLOW BYTES_PER_SECOND           limits the rate of all files together
// Faults act as in the kernel. The write before the fault is cut short. A full disk still truncates
// and renames; a read-only disk opens no file for writing.
#include <dlfcn.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <climits>
#include <cstdarg>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <mutex>
#include <optional>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

namespace {

using Clock = std::chrono::steady_clock;
using Seconds = std::chrono::duration<double>;

/// Returns the original function, which this library replaces.
template <class Function>
Function* real(const char* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
}

struct Fault {
  std::string what;
  double from = 0, seconds = 0;
  std::optional<Clock::time_point> began = {};

  int error() const {
    if (what == "ENOSPC") return ENOSPC;
    if (what == "EDQUOT") return EDQUOT;
    if (what == "ESTALE") return ESTALE;
    if (what == "EROFS") return EROFS;
    return what == "EIO" || what == "SYNC" ? EIO : 0;
  }
  bool acts_at(Clock::time_point now) const { return began && now < *began + Seconds(seconds); }
};

enum class Call { kRead, kCreate, kWrite, kTruncate, kRename, kSync };

bool refuses(const Fault& fault, Call call) {
  if (fault.what == "SYNC") return call == Call::kSync;
  if (fault.what == "ESTALE") return call == Call::kRead;
  if (fault.what == "ENOSPC" || fault.what == "EDQUOT") {
    return call == Call::kCreate || call == Call::kWrite;
  }
  if (fault.what == "EROFS") return call != Call::kSync && call != Call::kRead;
  return fault.what == "EIO" && call != Call::kRead;
}

class BadDisk {
 public:
  BadDisk() {
    if (const char* folder = std::getenv("BAD_DISK_FOLDER")) folder_ = folder;
    const char* given = std::getenv("BAD_DISK");
    std::istringstream faults(given == nullptr ? "" : given);
    for (std::string text; std::getline(faults, text, ';');) {
      Fault fault;
      std::istringstream(text) >> fault.what >> fault.from >> fault.seconds;
      if (fault.what == "SLOW") {
        bytes_per_second_ = fault.from;
      } else {
        faults_.push_back(fault);
      }
    }
  }

  bool holds(const std::filesystem::path& path) const {
    std::error_code error;
    const std::string whole = std::filesystem::weakly_canonical(path, error).string();
    return !folder_.empty() && !error && whole.starts_with(folder_ + "/");
  }
  bool holds(int file) const {
    std::array<char, PATH_MAX> path{};
    const std::string link = "/proc/self/fd/" + std::to_string(file);
    const bool is_file = readlink(link.c_str(), path.data(), path.size() - 1) > 0 && path[0] == '/';
    return is_file && holds(path.data());
  }

  /// Returns 0 or the errno of a fault. Waits while the disk stalls.
  int refusal(Call call) {
    std::unique_lock lock(mutex_);
    return refusal(call, lock);
  }

  /// Returns how many of `bytes` may be written; sets errno if none.
  std::size_t permit(std::size_t bytes) {
    std::unique_lock lock(mutex_);
    if (const int error = refusal(Call::kWrite, lock)) {
      errno = error;
      return 0;
    }
    for (Fault& fault : faults_) {
      // The write during which the fault begins is cut short.
      if (fault.began || fault.error() == 0 || fault.what == "SYNC" || fault.what == "ESTALE") {
        continue;
      }
      bytes = std::min(bytes, static_cast<std::size_t>(fault.from - written_));
    }
    written_ += static_cast<double>(bytes);
    if (bytes_per_second_ > 0) {
      free_at_ = std::max(free_at_, Clock::now()) +
                 std::chrono::duration_cast<Clock::duration>(
                     Seconds(static_cast<double>(bytes) / bytes_per_second_));
      const auto until = free_at_;
      lock.unlock();
      std::this_thread::sleep_until(until);
    }
    return bytes;
  }

 private:
  int refusal(Call call, std::unique_lock<std::mutex>& lock) {
    for (Fault& fault : faults_) {
      const auto now = Clock::now();
      if (!fault.began && written_ >= fault.from) fault.began = now;
      if (!fault.acts_at(now)) continue;
      if (fault.what == "STALL") {
        lock.unlock();
        std::this_thread::sleep_until(*fault.began + Seconds(fault.seconds));
        lock.lock();
      } else if (refuses(fault, call)) {
        return fault.error();
      }
    }
    return 0;
  }

  std::string folder_;
  double bytes_per_second_ = 0;
  std::mutex mutex_;
  std::vector<Fault> faults_;
  double written_ = 0;  // bytes
  Clock::time_point free_at_;
};

BadDisk& disk() {
  static BadDisk bad;
  return bad;
}

/// Calls `go_on` unless a fault acts.
template <class GoOn>
int unless_refused(bool concerned, Call call, GoOn&& go_on) {
  if (concerned) {
    if (const int error = disk().refusal(call)) {
      errno = error;
      return -1;
    }
  }
  return go_on();
}

ssize_t write_parts(int file, const iovec* parts, int count, off_t offset) {
  const auto pass_on = real<ssize_t(int, const iovec*, int, off_t)>("pwritev");
  if (!disk().holds(file)) return pass_on(file, parts, count, offset);
  std::vector<iovec> all(parts, parts + count);
  std::size_t bytes = 0;
  for (const iovec& part : all) bytes += part.iov_len;
  std::size_t left = bytes == 0 ? 0 : disk().permit(bytes);
  if (left == 0 && bytes > 0) return -1;
  for (iovec& part : all) {
    part.iov_len = std::min(part.iov_len, left);
    left -= part.iov_len;
  }
  return pass_on(file, all.data(), count, offset);
}

int open_file(const char* path, int flags, mode_t mode) {
  const bool writes = (flags & O_ACCMODE) != O_RDONLY || (flags & O_CREAT) != 0;
  return unless_refused(disk().holds(path), writes ? Call::kCreate : Call::kRead, [&] {
    return real<int(const char*, int, ...)>("open")(path, flags, mode);
  });
}

mode_t mode_of(int flags, va_list arguments) {
  const bool creates = (flags & O_CREAT) != 0 || (flags & O_TMPFILE) == O_TMPFILE;
  return creates ? va_arg(arguments, mode_t) : 0;
}

}  // namespace

extern "C" {

ssize_t pwritev(int file, const iovec* parts, int count, off_t offset) {
  return write_parts(file, parts, count, offset);
}
ssize_t pwritev64(int file, const iovec* parts, int count, off64_t offset) {
  return write_parts(file, parts, count, offset);
}
ssize_t writev(int file, const iovec* parts, int count) {  // std::ofstream calls it
  if (!disk().holds(file)) {
    return real<ssize_t(int, const iovec*, int)>("writev")(file, parts, count);
  }
  ssize_t written = 0;
  for (int i = 0; i < count; ++i) {
    const ssize_t part = ::write(file, parts[i].iov_base, parts[i].iov_len);
    if (part < 0) return written > 0 ? written : part;
    written += part;
    if (part < static_cast<ssize_t>(parts[i].iov_len)) break;
  }
  return written;
}
ssize_t write(int file, const void* bytes, std::size_t count) {
  if (file > STDERR_FILENO && count > 0 && disk().holds(file)) {
    count = disk().permit(count);
    if (count == 0) return -1;
  }
  return real<ssize_t(int, const void*, std::size_t)>("write")(file, bytes, count);
}
int open(const char* path, int flags, ...) {
  va_list arguments;
  va_start(arguments, flags);
  const mode_t mode = mode_of(flags, arguments);
  va_end(arguments);
  return open_file(path, flags, mode);
}
int open64(const char* path, int flags, ...) {
  va_list arguments;
  va_start(arguments, flags);
  const mode_t mode = mode_of(flags, arguments);
  va_end(arguments);
  return open_file(path, flags, mode);
}
FILE* fopen64(const char* path, const char* mode) {  // std::ifstream calls it
  if (mode[0] == 'r' && disk().holds(path)) {
    if (const int error = disk().refusal(Call::kRead)) {
      errno = error;
      return nullptr;
    }
  }
  return real<FILE*(const char*, const char*)>("fopen64")(path, mode);
}
int ftruncate(int file, off_t size) noexcept {
  return unless_refused(disk().holds(file), Call::kTruncate,
                        [&] { return real<int(int, off_t)>("ftruncate")(file, size); });
}
int rename(const char* from, const char* to) noexcept {
  return unless_refused(disk().holds(to), Call::kRename,
                        [&] { return real<int(const char*, const char*)>("rename")(from, to); });
}
int fdatasync(int file) {
  return unless_refused(disk().holds(file), Call::kSync,
                        [&] { return real<int(int)>("fdatasync")(file); });
}
int fsync(int file) {
  return unless_refused(disk().holds(file), Call::kSync,
                        [&] { return real<int(int)>("fsync")(file); });
}

}  // extern "C"
