// SPDX-License-Identifier: Apache-2.0
#include "sandbox/decoder_main.h"

#include <seccomp.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <csignal>
#include <cstdint>
#include <cstring>
#include <exception>
#include <new>
#include <stdexcept>
#include <string_view>

#include "sandbox/protocol.h"

namespace raystage::sandbox {
namespace {

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool kIsInstrumented = true;  // needs terabytes of addresses, and system calls of its own
#else
constexpr bool kIsInstrumented = false;
#endif

// What memory, files that are open already, and the end of the process need: no opening, no
// network, no other process.
constexpr std::array kPermittedCalls{
    SCMP_SYS(read),         SCMP_SYS(pread64),        SCMP_SYS(write),        SCMP_SYS(pwrite64),
    SCMP_SYS(lseek),        SCMP_SYS(close),          SCMP_SYS(sendto),       SCMP_SYS(recvmsg),
    SCMP_SYS(munmap),       SCMP_SYS(mremap),         SCMP_SYS(madvise),      SCMP_SYS(brk),
    SCMP_SYS(futex),        SCMP_SYS(clock_gettime),  SCMP_SYS(gettimeofday), SCMP_SYS(getrandom),
    SCMP_SYS(rt_sigaction), SCMP_SYS(rt_sigprocmask), SCMP_SYS(rt_sigreturn), SCMP_SYS(getpid),
    SCMP_SYS(gettid),       SCMP_SYS(sched_yield),    SCMP_SYS(exit),         SCMP_SYS(exit_group)};

std::uint64_t number(const char* text) {
  std::uint64_t value = 0;
  std::from_chars(text, text + std::strlen(text), value);
  return value;
}

/// Limits a resource, but never beyond what the process was started with.
void limit(__rlimit_resource resource, std::uint64_t value) {
  rlimit both{};
  if (::getrlimit(resource, &both) != 0) _exit(kNoLimits);
  both.rlim_cur = std::min<rlim_t>(value, both.rlim_max);
  // The signal of the limit of time comes at the lower, SIGKILL at the higher of the two.
  both.rlim_max = std::min<rlim_t>(value + 1, both.rlim_max);
  if (::setrlimit(resource, &both) != 0) _exit(kNoLimits);
}

bool filter_system_calls() {
  scmp_filter_ctx filter = seccomp_init(SCMP_ACT_ERRNO(EPERM));
  if (filter == nullptr) return false;
  bool is_complete = true;
  for (const int call : kPermittedCalls) {
    // Calls that this architecture does not have are no fault.
    const int code = seccomp_rule_add(filter, SCMP_ACT_ALLOW, call, 0);
    is_complete = is_complete && (code == 0 || code == -EDOM);
  }
  // abort() sends a signal, to this process only; memory is never made executable.
  is_complete = is_complete &&
                seccomp_rule_add(filter, SCMP_ACT_ALLOW, SCMP_SYS(tgkill), 1,
                                 SCMP_A0(SCMP_CMP_EQ, static_cast<scmp_datum_t>(::getpid()))) == 0;
  for (const int call : {SCMP_SYS(mmap), SCMP_SYS(mprotect)}) {
    is_complete = is_complete && seccomp_rule_add(filter, SCMP_ACT_ALLOW, call, 1,
                                                  SCMP_A2(SCMP_CMP_MASKED_EQ, PROT_EXEC, 0)) == 0;
  }
  is_complete = is_complete && seccomp_load(filter) == 0;
  seccomp_release(filter);
  return is_complete;
}

bool write_result(std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(kResultFile, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) return false;
    bytes = bytes.subspan(static_cast<std::size_t>(written));
  }
  return true;
}

int receive_file() {
  char answer = 0;
  iovec part{&answer, 1};
  alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(int))> control{};
  msghdr message{};
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  message.msg_control = control.data();
  message.msg_controllen = control.size();
  if (::recvmsg(kRequestSocket, &message, 0) != 1 || answer != static_cast<char>(Answer::kOpened)) {
    return -1;
  }
  const cmsghdr* const header = CMSG_FIRSTHDR(&message);
  if (header == nullptr || header->cmsg_type != SCM_RIGHTS) return -1;
  int file = -1;
  std::memcpy(&file, CMSG_DATA(header), sizeof file);
  return file;
}

}  // namespace

std::optional<std::vector<std::byte>> request_file(const std::string& name) {
  if (name.empty() || name.size() > kMaxName) return std::nullopt;
  if (::send(kRequestSocket, name.data(), name.size(), 0) != static_cast<ssize_t>(name.size())) {
    return std::nullopt;
  }
  const int file = receive_file();
  if (file < 0) return std::nullopt;
  std::optional<std::vector<std::byte>> bytes;
  if (const off_t size = ::lseek(file, 0, SEEK_END); size >= 0) {
    bytes.emplace(static_cast<std::size_t>(size));
    std::size_t done = 0;
    while (done < bytes->size()) {
      const ssize_t part =
          ::pread(file, bytes->data() + done, bytes->size() - done, static_cast<off_t>(done));
      if (part < 0 && errno == EINTR) continue;
      if (part <= 0) break;
      done += static_cast<std::size_t>(part);
    }
    bytes->resize(done);
  }
  ::close(file);
  return bytes;
}

int decoder_main(int argc, char** argv, const Decode& decode) {
  constexpr int kOwnArguments = 5;
  if (argc < kOwnArguments) return kRefused;
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0) return kNoLimits;
  if (!kIsInstrumented) limit(RLIMIT_AS, number(argv[2]));
  limit(RLIMIT_FSIZE, number(argv[3]));
  limit(RLIMIT_CPU, number(argv[4]));
  limit(RLIMIT_CORE, 0);
  const bool is_confined = std::string_view(argv[1]) == "confined";
  if (is_confined && !kIsInstrumented && !filter_system_calls()) return kNoFilter;
  std::set_new_handler(nullptr);
  try {
    const std::vector<std::byte> result =
        decode({argv + kOwnArguments, static_cast<std::size_t>(argc - kOwnArguments)});
    return write_result(result) ? kDecoded : kMemoryExceeded;
  } catch (const std::bad_alloc&) {
    return kMemoryExceeded;
  } catch (const std::length_error&) {  // of a size that no memory holds
    return kMemoryExceeded;
  } catch (const std::exception& error) {
    write_result(std::as_bytes(std::span(std::string_view(error.what()))));
    return kRefused;
  }
}

}  // namespace raystage::sandbox
