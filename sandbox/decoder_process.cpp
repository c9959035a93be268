// SPDX-License-Identifier: Apache-2.0
#include "sandbox/decoder_process.h"

#include <dlfcn.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <optional>
#include <string_view>
#include <thread>
#include <utility>

#include "base/error.h"
#include "sandbox/protocol.h"

namespace raystage::sandbox {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr int kMaxRequests = 10000;  // of files, by one decoder

/// Returns the program in lib/raystage: relative to the command, or to the library that other
/// programs link (lib/libraystage.so, lib/ARCHITECTURE/libraystage.so).
fs::path program_path(const std::string& name) {
  std::error_code error;
  const fs::path command = fs::read_symlink("/proc/self/exe", error).parent_path();
  const fs::path expected = (command / RAYSTAGE_MODULE_DIRECTORY / name).lexically_normal();
  if (fs::exists(expected, error)) return expected;
  Dl_info info{};
  if (::dladdr(reinterpret_cast<const void*>(&run_decoder), &info) == 0) return expected;
  const fs::path library = fs::canonical(info.dli_fname, error).parent_path();
  for (const fs::path folder : {"raystage", "../raystage", RAYSTAGE_MODULE_DIRECTORY}) {
    const fs::path program = (library / folder / name).lexically_normal();
    if (fs::exists(program, error)) return program;
  }
  return expected;
}

Error cannot_start(const std::string& reason, const fs::path& program) {
  return Error::failed("the decoder cannot be started: " + reason, program.string(),
                       "Reinstall raystage");
}

/// A child process, killed and waited for on destruction.
class Child {
 public:
  Child(const fs::path& program, const DecoderOptions& options, int socket, int result) {
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    // Not to the numbers themselves: one of them may be the other's.
    const int high = std::max(socket, result) + kResultFile + 1;
    posix_spawn_file_actions_adddup2(&actions, socket, high);
    posix_spawn_file_actions_adddup2(&actions, result, high + 1);
    posix_spawn_file_actions_adddup2(&actions, high, kRequestSocket);
    posix_spawn_file_actions_adddup2(&actions, high + 1, kResultFile);
    // Whatever else this process has open stays here.
    posix_spawn_file_actions_addclosefrom_np(&actions, kResultFile + 1);
    posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDWR, 0);
    posix_spawn_file_actions_adddup2(&actions, STDIN_FILENO, STDOUT_FILENO);
    posix_spawn_file_actions_adddup2(&actions, STDIN_FILENO, STDERR_FILENO);
    std::vector<std::string> words{
        program.string(), options.confinement == Confinement::kFull ? "confined" : "limited",
        std::to_string(options.memory_bytes), std::to_string(options.result_bytes),
        std::to_string(options.time.count())};
    words.insert(words.end(), options.arguments.begin(), options.arguments.end());
    std::vector<char*> argv;
    for (std::string& word : words) argv.push_back(word.data());
    argv.push_back(nullptr);
    // Signals to this process's group, such as Ctrl-C, are for this process to handle.
    posix_spawnattr_t attributes;
    posix_spawnattr_init(&attributes);
    sigset_t none, all;
    sigemptyset(&none);
    sigfillset(&all);
    posix_spawnattr_setsigmask(&attributes, &none);
    posix_spawnattr_setsigdefault(&attributes, &all);
    posix_spawnattr_setpgroup(&attributes, 0);
    posix_spawnattr_setflags(
        &attributes, POSIX_SPAWN_SETPGROUP | POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);
    const int code =
        posix_spawn(&id_, program.c_str(), &actions, &attributes, argv.data(), environ);
    posix_spawnattr_destroy(&attributes);
    posix_spawn_file_actions_destroy(&actions);
    if (code != 0) throw cannot_start(std::strerror(code), program);
  }
  ~Child() {
    if (id_ <= 0) return;
    ::kill(id_, SIGKILL);
    while (::waitpid(id_, nullptr, 0) < 0 && errno == EINTR) {
    }
  }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

  /// Waits for the end and returns waitpid()'s status, or nullopt if it does not come in time.
  std::optional<int> wait_until(Clock::time_point deadline) {
    constexpr auto kInterval = std::chrono::milliseconds(1);
    for (;;) {
      int status = 0;
      const pid_t ended = ::waitpid(id_, &status, WNOHANG);
      if (ended == id_) {
        id_ = 0;
        return status;
      }
      if (Clock::now() > deadline) return std::nullopt;
      std::this_thread::sleep_for(kInterval);
    }
  }

 private:
  pid_t id_ = 0;
};

void send_answer(int socket, const FileDescriptor& file) {
  char answer = static_cast<char>(file.open() ? Answer::kOpened : Answer::kNone);
  iovec part{&answer, 1};
  alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(int))> control{};
  msghdr message{};
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  if (file.open()) {
    message.msg_control = control.data();
    message.msg_controllen = control.size();
    cmsghdr* const header = CMSG_FIRSTHDR(&message);
    header->cmsg_level = SOL_SOCKET;
    header->cmsg_type = SCM_RIGHTS;
    header->cmsg_len = CMSG_LEN(sizeof(int));
    const int number = file.number();
    std::memcpy(CMSG_DATA(header), &number, sizeof number);
  }
  // Without waiting: a decoder that does not receive its answers gets none.
  (void)::sendmsg(socket, &message, MSG_NOSIGNAL | MSG_DONTWAIT);
}

/// Opens files for the decoder until it closes its end. Returns whether it did so in time.
bool answer_requests(int socket, const OpenFile& open_file, Clock::time_point deadline) {
  std::array<char, kMaxName> name{};
  for (int requests = 0; requests < kMaxRequests;) {
    const auto left =
        std::chrono::duration_cast<std::chrono::milliseconds>(deadline - Clock::now()).count();
    if (left <= 0) return false;
    pollfd waiting{socket, POLLIN, 0};
    const int ready = ::poll(&waiting, 1, static_cast<int>(left));
    if (ready < 0 && errno != EINTR) return false;
    if (ready <= 0) continue;
    const ssize_t length = ::recv(socket, name.data(), name.size(), MSG_DONTWAIT);
    if (length < 0 && (errno == EINTR || errno == EAGAIN)) continue;
    if (length <= 0) return true;
    ++requests;
    send_answer(socket, open_file(std::string(name.data(), static_cast<std::size_t>(length))));
  }
  return false;
}

std::vector<std::byte> read_result(int file, std::uint64_t max_bytes) {
  const off_t size = ::lseek(file, 0, SEEK_END);
  if (size < 0 || static_cast<std::uint64_t>(size) > max_bytes) return {};
  std::vector<std::byte> bytes(static_cast<std::size_t>(size));
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t part =
        ::pread(file, bytes.data() + done, bytes.size() - done, static_cast<off_t>(done));
    if (part < 0 && errno == EINTR) continue;
    if (part <= 0) return {};
    done += static_cast<std::size_t>(part);
  }
  return bytes;
}

/// The reason of a decoder is text of a stranger: of bounded length.
std::string reason_in(const std::vector<std::byte>& bytes) {
  constexpr std::size_t kMaxReason = 500;
  return {reinterpret_cast<const char*>(bytes.data()), std::min(bytes.size(), kMaxReason)};
}

}  // namespace

std::vector<std::byte> run_decoder(const DecoderOptions& options, const OpenFile& open_file) {
  const fs::path program = program_path(options.program);
  std::array<int, 2> ends{};
  if (::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends.data()) != 0) {
    throw cannot_start(std::strerror(errno), program);
  }
  const FileDescriptor socket(ends[0]);
  FileDescriptor of_child(ends[1]);
  const FileDescriptor result(::memfd_create("raystage-decoded", MFD_CLOEXEC));
  if (!result.open()) throw cannot_start(std::strerror(errno), program);
  Child child(program, options, of_child.number(), result.number());
  of_child.close();

  const auto refuse = [&](const std::string& why, const std::string& what_to_do) {
    return Error::bad_input(fmt::format("the {} cannot be read: {}", options.kind, why),
                            options.file.string(), what_to_do);
  };
  const std::string is_damaged = "The file is damaged, or made to do harm: export it again";
  // By the clock much longer, because others may use the processors.
  const std::chrono::seconds most = 4 * options.time + std::chrono::seconds(10);
  const Clock::time_point deadline = Clock::now() + most;
  const auto not_in_time = [&] {
    return refuse(fmt::format("its decoder did not end within {} s, or asked for too many files",
                              most.count()),
                  is_damaged);
  };
  if (!answer_requests(socket.number(), open_file, deadline)) throw not_in_time();
  const std::optional<int> ended = child.wait_until(deadline);
  if (!ended) throw not_in_time();
  const int status = *ended;
  if (WIFSIGNALED(status)) {
    const int signal = WTERMSIG(status);
    if (signal == SIGKILL) {
      throw Error::failed(fmt::format("the decoder of a {} was killed", options.kind),
                          options.file.string(), "Free memory, and try again");
    }
    if (signal == SIGXCPU) {
      throw refuse(fmt::format("its decoder took more than {} s", options.time.count()),
                   is_damaged);
    }
    throw refuse(fmt::format("its decoder crashed ({})", ::strsignal(signal)), is_damaged);
  }
  switch (WEXITSTATUS(status)) {
    case kDecoded:
      return read_result(result.number(), options.result_bytes);
    case kRefused:
      throw refuse(reason_in(read_result(result.number(), options.result_bytes)),
                   "Export it again");
    case kMemoryExceeded:
      throw refuse(fmt::format("its decoder needs more than {} MB of memory",
                               options.memory_bytes / 1'000'000),
                   is_damaged);
    case kNoLimits:
      throw cannot_start("its limits cannot be set", program);
    case kNoFilter:
      throw Error::failed(
          fmt::format("the {} cannot be read safely: the kernel has no filter of system calls "
                      "(seccomp)",
                      options.kind),
          options.file.string(), "Use a kernel with seccomp");
    default:
      throw cannot_start(fmt::format("exit code {}", WEXITSTATUS(status)), program);
  }
}

}  // namespace raystage::sandbox
