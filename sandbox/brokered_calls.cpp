// SPDX-License-Identifier: Apache-2.0
// Answers trapped system calls in the SIGSYS handler: the arguments are read from the registers of
// the interrupted code, the result is put there. All calls below are safe in signal handlers.
#include "sandbox/brokered_calls.h"

#include <fcntl.h>
#include <sched.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <ucontext.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstddef>
#include <cstring>

#include "sandbox/protocol.h"

namespace raystage::sandbox {
namespace {

constexpr std::array kBrokeredCalls{
    int{SYS_openat}, int{SYS_newfstatat}, int{SYS_faccessat}, int{SYS_faccessat2},
#ifdef SYS_open
    int{SYS_open},   int{SYS_stat},       int{SYS_lstat},     int{SYS_access},
#endif
};

/// The arguments of a system call, in the interrupted code's registers.
class TrappedCall {
 public:
  explicit TrappedCall(void* context)
      : registers_(static_cast<ucontext_t*>(context)->uc_mcontext) {}

#if defined(__x86_64__)
  long argument(int index) const {
    constexpr std::array kRegisters{REG_RDI, REG_RSI, REG_RDX, REG_R10};
    return static_cast<long>(registers_.gregs[kRegisters.at(static_cast<std::size_t>(index))]);
  }
  void set_result(long result) { registers_.gregs[REG_RAX] = result; }
#elif defined(__aarch64__)
  long argument(int index) const { return static_cast<long>(registers_.regs[index]); }
  void set_result(long result) { registers_.regs[0] = static_cast<unsigned long long>(result); }
#else
#error "The registers of system calls on this architecture are not known"
#endif
  template <class T>
  T* pointer(int index) const {
    return reinterpret_cast<T*>(argument(index));
  }

 private:
  mcontext_t& registers_;
};

/// Receives the answer to kOpen.
int receive_descriptor() {
  char answer = 0;
  iovec part{&answer, 1};
  alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(int))> control{};
  msghdr message{};
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  message.msg_control = control.data();
  message.msg_controllen = control.size();
  if (::recvmsg(kSocket, &message, 0) != 1 || answer != static_cast<char>(Message::kOpened)) {
    return -1;
  }
  const cmsghdr* const header = CMSG_FIRSTHDR(&message);
  if (header == nullptr || header->cmsg_type != SCM_RIGHTS) return -1;
  int file = -1;
  std::memcpy(&file, CMSG_DATA(header), sizeof file);
  return file;
}

long open_by_name(const char* name, long flags) {
  if (name == nullptr) return -EFAULT;
  if ((flags & O_ACCMODE) != O_RDONLY || (flags & (O_CREAT | O_TRUNC)) != 0) return -EACCES;
  const int file = request_descriptor(name);
  return file < 0 ? -ENOENT : file;
}

/// fstat() as a system call of its own: the one of the C library is trapped.
long status_of(long file, struct stat* status) {
  return ::syscall(SYS_fstat, file, status) == 0 ? 0 : -errno;
}

long status_by_name(const char* name, struct stat* status) {
  const long file = open_by_name(name, O_RDONLY);
  if (file < 0) return file;
  const long result = status_of(file, status);
  ::close(static_cast<int>(file));
  return result;
}

long access_by_name(const char* name, long mode) {
  if ((mode & (W_OK | X_OK)) != 0) return -EACCES;
  const long file = open_by_name(name, O_RDONLY);
  if (file < 0) return file;
  ::close(static_cast<int>(file));
  return 0;
}

long answer(int call, const TrappedCall& trapped) {
  switch (call) {
    case SYS_openat:
      return open_by_name(trapped.pointer<const char>(1), trapped.argument(2));
    case SYS_newfstatat: {
      const auto* const name = trapped.pointer<const char>(1);
      auto* const status = trapped.pointer<struct stat>(2);
      const bool is_of_descriptor =
          (trapped.argument(3) & AT_EMPTY_PATH) != 0 && (name == nullptr || name[0] == '\0');
      return is_of_descriptor ? status_of(trapped.argument(0), status)
                              : status_by_name(name, status);
    }
    case SYS_faccessat:
    case SYS_faccessat2:
      return access_by_name(trapped.pointer<const char>(1), trapped.argument(2));
#ifdef SYS_open
    case SYS_open:
      return open_by_name(trapped.pointer<const char>(0), trapped.argument(1));
    case SYS_stat:
    case SYS_lstat:
      return status_by_name(trapped.pointer<const char>(0), trapped.pointer<struct stat>(1));
    case SYS_access:
      return access_by_name(trapped.pointer<const char>(0), trapped.argument(1));
#endif
    default:
      return -EPERM;
  }
}

void handle_trap(int /*signal*/, siginfo_t* info, void* context) {
  const int error = errno;
  TrappedCall trapped(context);
  trapped.set_result(answer(info->si_syscall, trapped));
  errno = error;
}

}  // namespace

int request_descriptor(std::string_view name) {
  if (name.empty() || name.size() > kMaxText) return -1;
  // One question at a time, so that each thread gets its own answer. No call below is trapped.
  static std::atomic_flag is_asking;
  while (is_asking.test_and_set(std::memory_order_acquire)) sched_yield();
  struct Release {
    ~Release() { is_asking.clear(std::memory_order_release); }
  } release;
  std::array<char, kMaxText + 1> message{};
  message[0] = static_cast<char>(Message::kOpen);
  std::memcpy(message.data() + 1, name.data(), name.size());
  const std::size_t size = name.size() + 1;
  if (::send(kSocket, message.data(), size, MSG_NOSIGNAL) != static_cast<ssize_t>(size)) return -1;
  return receive_descriptor();
}

std::span<const int> brokered_calls() { return kBrokeredCalls; }

bool install_call_broker() {
  struct sigaction action {};
  action.sa_sigaction = handle_trap;
  action.sa_flags = SA_SIGINFO;
  return ::sigaction(SIGSYS, &action, nullptr) == 0;
}

}  // namespace raystage::sandbox
