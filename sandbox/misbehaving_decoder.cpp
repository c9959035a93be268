// SPDX-License-Identifier: Apache-2.0
// A decoder for tests that does what its argument says.
#include <fcntl.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "sandbox/decoder_main.h"

namespace {

std::vector<std::byte> bytes_of(const std::string& text) {
  const auto* const bytes = reinterpret_cast<const std::byte*>(text.data());
  return {bytes, bytes + text.size()};
}

/// What a decoder must not be able to do; empty: nothing of it.
std::string escapes() {
  std::string done;
  if (::open("/etc/passwd", O_RDONLY) >= 0) done += "open ";
  if (::openat(AT_FDCWD, "/tmp", O_RDONLY | O_DIRECTORY) >= 0) done += "openat ";
  if (::socket(AF_INET, SOCK_STREAM, 0) >= 0) done += "socket ";
  if (::kill(::getppid(), 0) == 0) done += "kill ";
  if (::syscall(SYS_tgkill, ::getppid(), ::getppid(), 0) == 0) done += "tgkill ";
  if (::mmap(nullptr, 4096, PROT_READ | PROT_EXEC, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0) !=
      MAP_FAILED) {
    done += "exec memory ";
  }
  ::execl("/no/such/program", "program", nullptr);
  if (errno != EPERM) done += "exec ";
  if (::unlink("/tmp/raystage-no-such-file") == 0 || errno != EPERM) done += "unlink ";
  if (const pid_t child = ::fork(); child >= 0) {
    if (child == 0) _exit(0);
    done += "fork ";
  }
  return done;
}

/// Looks at a file and reads it as libraries do, by name.
std::string read_by_name(const std::string& name) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(name, error) || ::access(name.c_str(), W_OK) == 0) {
    return "none";
  }
  std::ifstream file(name, std::ios::binary);
  std::string text{std::istreambuf_iterator<char>(file), {}};
  return std::to_string(std::filesystem::file_size(name)) + " " + text;
}

/// Reads a file by name in each of four threads.
std::string read_in_threads(const std::string& name) {
  std::array<std::string, 4> texts;
  std::vector<std::thread> threads;
  for (std::string& text : texts) {
    threads.emplace_back([&] {
      for (int i = 0; i < 50; ++i) text = read_by_name(name);
    });
  }
  for (std::thread& thread : threads) thread.join();
  return texts[0] + "|" + texts[1] + "|" + texts[2] + "|" + texts[3];
}

void wait_for_ever() {
  std::atomic<int> never = 0;
  for (;;) never.wait(0);
}

std::vector<std::byte> misbehave(std::span<const std::byte> request) {
  const std::string what(reinterpret_cast<const char*>(request.data()), request.size());
  constexpr std::string_view kByName = "by name: ";
  if (what.starts_with(kByName)) return bytes_of(read_by_name(what.substr(kByName.size())));
  constexpr std::string_view kInThreads = "in threads: ";
  if (what.starts_with(kInThreads))
    return bytes_of(read_in_threads(what.substr(kInThreads.size())));
  if (what == "process") return bytes_of(std::to_string(::getpid()));
  if (what == "environment") return bytes_of(environ[0] == nullptr ? "" : environ[0]);
  if (what == "crash") ::raise(SIGSEGV);
  if (what == "loop") {
    for (std::atomic<int> i = 0;; ++i) {
    }
  }
  if (what == "sleep") {
    ::close(3);  // the parent sees the end of its requests
    wait_for_ever();
  }
  if (what == "wait") wait_for_ever();
  if (what == "false size") {  // of a file without memory behind it
    ::ftruncate(4, 40'000'000);
    const char message[9] = {'R', 0, 0, 0, 2, 0, 0, 0, 0};  // 2^25 bytes
    ::send(3, message, sizeof message, 0);
    wait_for_ever();
  }
  if (what == "two answers") {
    const char message[9] = {'R'};
    ::send(3, message, sizeof message, 0);
    ::send(3, message, sizeof message, 0);
    wait_for_ever();
  }
  if (what == "flood and answer") {
    for (int i = 0; i < 9000; ++i) ::send(3, "Oa", 2, 0);
  }
  if (what == "flood") {
    for (;;) ::send(3, "O", 1, MSG_DONTWAIT);
  }
  if (what == "allocate") {
    std::vector<std::vector<char>> all;
    for (;;) all.emplace_back(1 << 20, 'x');
  }
  if (what == "write") return std::vector<std::byte>(std::size_t{64} << 20);
  if (what == "refuse") throw std::runtime_error("no such thing");
  if (what == "escape") return bytes_of(escapes());
  if (what == "requests") {
    for (;;) raystage::sandbox::request_file("a");
  }
  const auto file = raystage::sandbox::request_file(what);
  return file ? *file : bytes_of("none");
}

}  // namespace

int main(int argc, char** argv) { return raystage::sandbox::decoder_main(argc, argv, misbehave); }
