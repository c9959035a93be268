// SPDX-License-Identifier: Apache-2.0
#include "sandbox/decoder_main.h"

#include <fcntl.h>
#include <pthread.h>
#include <sched.h>
#include <seccomp.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <csignal>
#include <cstdint>
#include <cstring>
#include <exception>
#include <fstream>
#include <new>
#include <stdexcept>
#include <string_view>

#include "sandbox/brokered_calls.h"
#include "sandbox/protocol.h"

namespace raystage::sandbox {
namespace {

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool kIsInstrumented = true;  // needs terabytes of addresses, and system calls of its own
#else
constexpr bool kIsInstrumented = false;
#endif

// What memory, threads, files that are open already, and the end of the process need: no network,
// no other process. Files are opened by the parent, see brokered_calls.h.
constexpr std::array kPermittedCalls{SCMP_SYS(read),
                                     SCMP_SYS(pread64),
                                     SCMP_SYS(write),
                                     SCMP_SYS(pwrite64),
                                     SCMP_SYS(readv),
                                     SCMP_SYS(lseek),
                                     SCMP_SYS(close),
                                     SCMP_SYS(fstat),
                                     SCMP_SYS(ftruncate),
                                     SCMP_SYS(sendto),
                                     SCMP_SYS(recvfrom),
                                     SCMP_SYS(recvmsg),
                                     SCMP_SYS(munmap),
                                     SCMP_SYS(mremap),
                                     SCMP_SYS(madvise),
                                     SCMP_SYS(brk),
                                     SCMP_SYS(futex),
                                     SCMP_SYS(clock_gettime),
                                     SCMP_SYS(gettimeofday),
                                     SCMP_SYS(getrandom),
                                     SCMP_SYS(rt_sigaction),
                                     SCMP_SYS(rt_sigprocmask),
                                     SCMP_SYS(rt_sigreturn),
                                     SCMP_SYS(getpid),
                                     SCMP_SYS(gettid),
                                     SCMP_SYS(getcwd),
                                     SCMP_SYS(sched_yield),
                                     SCMP_SYS(setitimer),
                                     SCMP_SYS(exit),
                                     SCMP_SYS(exit_group),
                                     SCMP_SYS(rseq),
                                     SCMP_SYS(set_robust_list),
                                     SCMP_SYS(sched_getaffinity)};
constexpr std::array kPermittedFcntls{F_GETFL, F_GETFD, F_SETFD};

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
  both.rlim_max = both.rlim_cur;
  if (::setrlimit(resource, &both) != 0) _exit(kNoLimits);
}

/// Limits what the process takes beyond what its program and libraries have taken: writable memory,
/// and more loosely all addresses, because files are mapped and heaps of threads reserve some.
/// Stacks of threads are small, because they count as a whole.
void limit_memory(std::uint64_t bytes) {
  constexpr std::size_t kStackBytes = std::size_t{1} << 20;
  pthread_attr_t attributes;
  pthread_attr_init(&attributes);
  pthread_attr_setstacksize(&attributes, kStackBytes);
  if (pthread_setattr_default_np(&attributes) != 0) _exit(kNoLimits);
  pthread_attr_destroy(&attributes);
  constexpr std::uint64_t kReserved = std::uint64_t{1} << 30;
  std::ifstream file("/proc/self/statm");
  std::uint64_t size = 0, resident = 0, shared = 0, code = 0, unused = 0, data = 0;  // pages
  if (!(file >> size >> resident >> shared >> code >> unused >> data)) _exit(kNoProc);
  const auto page = static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
  limit(RLIMIT_DATA, data * page + bytes);
  limit(RLIMIT_AS, size * page + bytes + kReserved);
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
  is_complete = is_complete && seccomp_rule_add(filter, SCMP_ACT_ALLOW, SCMP_SYS(mprotect), 1,
                                                SCMP_A2(SCMP_CMP_MASKED_EQ, PROT_EXEC, 0)) == 0;
  // Shared memory would not count.
  is_complete = is_complete && seccomp_rule_add(filter, SCMP_ACT_ALLOW, SCMP_SYS(mmap), 2,
                                                SCMP_A2(SCMP_CMP_MASKED_EQ, PROT_EXEC, 0),
                                                SCMP_A3(SCMP_CMP_MASKED_EQ, MAP_SHARED, 0)) == 0;
  // Threads of this process (libheif has some). The C library uses clone() where the kernel lacks
  // clone3(), whose arguments a filter cannot see.
  is_complete = is_complete &&
                seccomp_rule_add(filter, SCMP_ACT_ALLOW, SCMP_SYS(clone), 1,
                                 SCMP_A0(SCMP_CMP_MASKED_EQ, CLONE_THREAD, CLONE_THREAD)) == 0 &&
                seccomp_rule_add(filter, SCMP_ACT_ERRNO(ENOSYS), SCMP_SYS(clone3), 0) == 0;
  for (const int command : kPermittedFcntls) {
    is_complete = is_complete &&
                  seccomp_rule_add(filter, SCMP_ACT_ALLOW, SCMP_SYS(fcntl), 1,
                                   SCMP_A1(SCMP_CMP_EQ, static_cast<scmp_datum_t>(command))) == 0;
  }
  for (const int call : brokered_calls()) {
    is_complete = is_complete && seccomp_rule_add(filter, SCMP_ACT_TRAP, call, 0) == 0;
  }
  is_complete = is_complete && seccomp_load(filter) == 0;
  seccomp_release(filter);
  return is_complete;
}

/// Reads up to bytes.size() bytes from the start of a file; returns how many there are.
std::size_t read_all(int file, std::span<std::byte> bytes) {
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t part =
        ::pread(file, bytes.data() + done, bytes.size() - done, static_cast<off_t>(done));
    if (part < 0 && errno == EINTR) continue;
    if (part <= 0) break;
    done += static_cast<std::size_t>(part);
  }
  return done;
}

bool write_result(std::span<const std::byte> bytes) {
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t part =
        ::pwrite(kSharedMemory, bytes.data() + done, bytes.size() - done, static_cast<off_t>(done));
    if (part < 0 && errno == EINTR) continue;
    if (part <= 0) return false;
    done += static_cast<std::size_t>(part);
  }
  return true;
}

/// Sends a message of a kind and what follows it.
void send_message(Message kind, std::span<const std::byte> contents) {
  std::array<std::byte, kMaxText + 1> message{};
  message[0] = static_cast<std::byte>(kind);
  const std::size_t size = std::min(contents.size(), kMaxText);
  std::copy_n(contents.begin(), size, message.begin() + 1);
  (void)::send(kSocket, message.data(), size + 1, MSG_NOSIGNAL);
}

/// Receives a request; nullopt: there are no more. Throws std::runtime_error if it is none.
std::optional<std::vector<std::byte>> receive_request() {
  std::array<std::byte, 1 + kMaxText> message{};
  ssize_t received = -1;
  do received = ::recv(kSocket, message.data(), message.size(), 0);
  while (received < 0 && errno == EINTR);
  if (received == 0) return std::nullopt;
  if (received < 0) throw std::runtime_error("no request");
  const auto kind = static_cast<Message>(message[0]);
  const std::span<const std::byte> contents =
      std::span(message).subspan(1, static_cast<std::size_t>(received) - 1);
  if (kind == Message::kRequest) return std::vector(contents.begin(), contents.end());
  std::uint64_t bytes = 0;
  if (kind != Message::kLargeRequest || contents.size() != sizeof bytes) {
    throw std::runtime_error("not a request");
  }
  std::memcpy(&bytes, contents.data(), sizeof bytes);
  std::vector<std::byte> request(static_cast<std::size_t>(bytes));
  request.resize(read_all(kSharedMemory, request));
  return request;
}

void answer_one(const AnswerRequest& answer, std::span<const std::byte> request) {
  try {
    const std::vector<std::byte> result = answer(request);
    if (!write_result(result)) return send_message(Message::kMemory, {});
    const std::uint64_t size = result.size();
    send_message(Message::kResult, std::as_bytes(std::span(&size, 1)));
  } catch (const std::bad_alloc&) {
    send_message(Message::kMemory, {});
  } catch (const std::length_error&) {  // of a size that no memory holds
    send_message(Message::kMemory, {});
  } catch (const std::exception& error) {
    send_message(Message::kRefusal, std::as_bytes(std::span(std::string_view(error.what()))));
  }
}

/// Ends the process if a request takes longer, in case that its parent is no more.
void set_timer(std::uint64_t seconds) {
  const itimerval timer{{}, {static_cast<time_t>(seconds), 0}};
  ::setitimer(ITIMER_REAL, &timer, nullptr);
}

}  // namespace

std::optional<std::vector<std::byte>> request_file(const std::string& name) {
  const int file = request_descriptor(name);
  if (file < 0) return std::nullopt;
  std::optional<std::vector<std::byte>> bytes;
  if (const off_t size = ::lseek(file, 0, SEEK_END); size >= 0) {
    bytes.emplace(static_cast<std::size_t>(size));
    bytes->resize(read_all(file, *bytes));
  }
  ::close(file);
  return bytes;
}

int decoder_main(int argc, char** argv, const AnswerRequest& answer) {
  constexpr int kArguments = 5;
  if (argc != kArguments) return kBroken;
  if (::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0) return kNoLimits;
  if (!kIsInstrumented) limit_memory(number(argv[2]));
  limit(RLIMIT_FSIZE, number(argv[3]));
  limit(RLIMIT_CORE, 0);
  constexpr std::uint64_t kDay = 24 * 3600;  // in case that its parent was killed
  limit(RLIMIT_CPU, kDay);
  const std::uint64_t seconds = number(argv[4]);
  const bool is_confined = std::string_view(argv[1]) == "confined";
  if (is_confined && !kIsInstrumented && !(install_call_broker() && filter_system_calls())) {
    return kNoFilter;
  }
  std::set_new_handler(nullptr);
  ::signal(SIGXFSZ, SIG_IGN);  // a result that is too large is an error of write()
  try {
    while (const auto request = receive_request()) {
      set_timer(seconds);
      answer_one(answer, *request);
      set_timer(0);
    }
    return kEnded;
  } catch (const std::exception&) {
    return kBroken;
  }
}

}  // namespace raystage::sandbox
