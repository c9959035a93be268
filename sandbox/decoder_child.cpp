// SPDX-License-Identifier: Apache-2.0
// Starts a decoder's program by posix_spawn(): a renderer has threads, whose locks a forked copy
// would inherit.
#include "sandbox/decoder_child.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <thread>
#include <vector>

#include "base/module_file.h"
#include "sandbox/protocol.h"

namespace raystage::sandbox {
namespace {

namespace fs = std::filesystem;

/// The environment may hold secrets, which are no business of a decoder: it gets what loading the
/// program needs, and the options of sanitizers.
std::vector<std::string> variables_of_decoder(Environment environment) {
  // No thread may be started. Large pages make large buffers, which libraries clear, much cheaper.
  std::vector<std::string> variables{"OMP_NUM_THREADS=1", "GLIBC_TUNABLES=glibc.malloc.hugetlb=1"};
  if (environment == Environment::kInherited) {
    for (char** variable = environ; *variable != nullptr; ++variable)
      variables.emplace_back(*variable);
    return variables;
  }
  for (const char* name : {"LD_LIBRARY_PATH", "ASAN_OPTIONS", "UBSAN_OPTIONS", "TSAN_OPTIONS"}) {
    if (const char* value = std::getenv(name)) {
      variables.push_back(std::string(name) + "=" + value);
    }
  }
  return variables;
}

std::array<int, 2> make_sockets(const fs::path& program) {
  std::array<int, 2> ends{};
  if (::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends.data()) != 0) {
    throw cannot_start(std::strerror(errno), program);
  }
  return ends;
}

}  // namespace

Error cannot_start(const std::string& reason, const fs::path& program) {
  return Error::failed("the decoder cannot be started: " + reason, program.string(),
                       "Reinstall raystage");
}

std::chrono::seconds longest_wait(const DecoderOptions& options) {
  return 2 * options.time + std::chrono::seconds(10);
}

DecoderProcess::Child::Child(const DecoderOptions& options)
    : Child(options, make_sockets(module_path(options.program))) {}

DecoderProcess::Child::Child(const DecoderOptions& options, std::array<int, 2> sockets)
    : program_(module_path(options.program)),
      socket_(sockets[0]),
      memory_(::memfd_create("raystage-decoded", MFD_CLOEXEC)) {
  FileDescriptor of_child(sockets[1]);
  if (!memory_.open()) throw cannot_start(std::strerror(errno), program_);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  // Not to the numbers themselves: one of them may be the other's.
  const int high = std::max(of_child.number(), memory_.number()) + kSharedMemory + 1;
  posix_spawn_file_actions_adddup2(&actions, of_child.number(), high);
  posix_spawn_file_actions_adddup2(&actions, memory_.number(), high + 1);
  posix_spawn_file_actions_adddup2(&actions, high, kSocket);
  posix_spawn_file_actions_adddup2(&actions, high + 1, kSharedMemory);
  // Whatever else this process has open stays here.
  posix_spawn_file_actions_addclosefrom_np(&actions, kSharedMemory + 1);
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDWR, 0);
  posix_spawn_file_actions_adddup2(&actions, STDIN_FILENO, STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, STDIN_FILENO, STDERR_FILENO);
  constexpr std::chrono::seconds kMargin{60};  // the parent, if there is one, comes first
  std::vector<std::string> words{
      program_.string(), options.confinement == Confinement::kFull ? "confined" : "limited",
      std::to_string(options.memory_bytes), std::to_string(options.result_bytes),
      std::to_string((longest_wait(options) + kMargin).count())};
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  std::vector<std::string> variables = variables_of_decoder(options.environment);
  std::vector<char*> environment;
  for (std::string& variable : variables) environment.push_back(variable.data());
  environment.push_back(nullptr);
  // Signals to this process's group, such as Ctrl-C, are for this process to handle.
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  sigset_t none, all;
  sigemptyset(&none);
  sigfillset(&all);
  posix_spawnattr_setsigmask(&attributes, &none);
  posix_spawnattr_setsigdefault(&attributes, &all);
  posix_spawnattr_setpgroup(&attributes, 0);
  posix_spawnattr_setflags(&attributes,
                           POSIX_SPAWN_SETPGROUP | POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);
  const int code =
      posix_spawn(&id_, program_.c_str(), &actions, &attributes, argv.data(), environment.data());
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&actions);
  if (code != 0) throw cannot_start(std::strerror(code), program_);
}

DecoderProcess::Child::~Child() {
  if (id_ <= 0) return;
  ::kill(id_, SIGKILL);
  while (::waitpid(id_, nullptr, 0) < 0 && errno == EINTR) {
  }
}

std::optional<std::chrono::nanoseconds> DecoderProcess::Child::processor_time() const {
  clockid_t clock{};
  timespec time{};
  if (::clock_getcpuclockid(id_, &clock) != 0 || ::clock_gettime(clock, &time) != 0) {
    return std::nullopt;
  }
  return std::chrono::seconds(time.tv_sec) + std::chrono::nanoseconds(time.tv_nsec);
}

std::optional<int> DecoderProcess::Child::wait_until(
    std::chrono::steady_clock::time_point deadline) {
  constexpr auto kInterval = std::chrono::milliseconds(1);
  for (;;) {
    int status = 0;
    const pid_t ended = ::waitpid(id_, &status, WNOHANG);
    if (ended == id_) {
      id_ = 0;
      return status;
    }
    if (std::chrono::steady_clock::now() > deadline) return std::nullopt;
    std::this_thread::sleep_for(kInterval);
  }
}

}  // namespace raystage::sandbox
