// SPDX-License-Identifier: Apache-2.0
#include "sandbox/decoder_process.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <string_view>
#include <utility>

#include "base/cancellation.h"
#include "base/contained_path.h"
#include "base/error.h"
#include "sandbox/decoder_child.h"
#include "sandbox/protocol.h"

namespace raystage::sandbox {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr std::uint64_t kBlockBytes = 512;  // of st_blocks
constexpr int kMaxMessages = 10000;         // of a decoder, for one request
constexpr const char* kIsDamaged = "The file is damaged, or made to do harm: export it again";

/// Returns whether the answer was sent: a decoder that does not receive its answers must end.
bool send_answer(int socket, const FileDescriptor& file) {
  char answer = static_cast<char>(file.open() ? Message::kOpened : Message::kNotOpened);
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
  return ::sendmsg(socket, &message, MSG_NOSIGNAL | MSG_DONTWAIT) == 1;
}

bool write_all(int file, std::span<const std::byte> bytes) {
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t part =
        ::pwrite(file, bytes.data() + done, bytes.size() - done, static_cast<off_t>(done));
    if (part < 0 && errno == EINTR) continue;
    if (part <= 0) return false;
    done += static_cast<std::size_t>(part);
  }
  return true;
}

/// Returns the first `size` bytes of a file, or nothing if it does not have so many.
std::vector<std::byte> read_all(int file, std::uint64_t size) {
  struct stat status {};
  if (::fstat(file, &status) != 0 || static_cast<std::uint64_t>(status.st_size) < size ||
      static_cast<std::uint64_t>(status.st_blocks) * kBlockBytes < size) {
    return {};  // a size without the memory for it must not cost this process any
  }
  std::vector<std::byte> bytes(static_cast<std::size_t>(size));
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t part =
        ::pread(file, bytes.data() + done, bytes.size() - done, static_cast<off_t>(done));
    if (part < 0 && errno == EINTR) continue;
    if (part <= 0) break;
    done += static_cast<std::size_t>(part);
  }
  bytes.resize(done);
  return bytes;
}

/// A message of a decoder.
struct Received {
  Message kind{};
  std::string contents;

  std::uint64_t number() const {
    std::uint64_t value = 0;
    if (contents.size() == sizeof value) std::memcpy(&value, contents.data(), sizeof value);
    return value;
  }
};

}  // namespace

/// One request: its messages, and how long they take.
class DecoderProcess::Exchange {
 public:
  Exchange(const DecoderOptions& options, Child& child, const fs::path& file)
      : options_(options),
        child_(child),
        file_(file),
        deadline_(Clock::now() + longest_wait(options)),
        time_before_(child.processor_time().value_or(std::chrono::nanoseconds(0))) {}

  void send_request(std::span<const std::byte> request) {
    // A small one needs no memory, which counts as a file where the size of files is limited.
    const bool is_small = request.size() <= kMaxText;
    const std::uint64_t size = request.size();
    const std::span<const std::byte> contents =
        is_small ? request : std::as_bytes(std::span(&size, 1));
    std::vector<std::byte> message{
        static_cast<std::byte>(is_small ? Message::kRequest : Message::kLargeRequest)};
    message.insert(message.end(), contents.begin(), contents.end());
    const bool is_sent =
        (is_small || write_all(child_.memory(), request)) && !has_message() &&
        ::send(child_.socket(), message.data(), message.size(), MSG_NOSIGNAL | MSG_DONTWAIT) ==
            static_cast<ssize_t>(message.size());
    if (!is_sent) throw ended();
  }
  void answer(const FileDescriptor& file) {
    if (!send_answer(child_.socket(), file)) throw ended();
  }

  /// Receives the next message. Throws Error if the decoder ends or exceeds its time.
  Received receive() {
    if (++messages_ > kMaxMessages)
      throw refusal("its decoder asked for too many files", kIsDamaged);
    std::array<char, kMaxText + 1> message{};
    for (;;) {
      throw_if_cancelled();
      require_time();
      constexpr int kPollMilliseconds = 50;
      pollfd waiting{child_.socket(), POLLIN, 0};
      const int ready = ::poll(&waiting, 1, kPollMilliseconds);
      if (ready == 0 || (ready < 0 && errno == EINTR)) continue;
      const ssize_t length = ::recv(child_.socket(), message.data(), message.size(), MSG_DONTWAIT);
      if (length < 0 && (errno == EINTR || errno == EAGAIN)) continue;
      if (length <= 0) throw ended();
      return {static_cast<Message>(message[0]),
              std::string(message.data() + 1, static_cast<std::size_t>(length) - 1)};
    }
  }

  std::vector<std::byte> result_of(const Received& received) {
    switch (received.kind) {
      case Message::kResult: {
        const std::uint64_t size = received.number();
        if (size > options_.result_bytes) break;
        std::vector<std::byte> bytes = read_all(child_.memory(), size);
        if (!free_memory() || bytes.size() != size) break;
        return bytes;
      }
      case Message::kRefusal: {
        constexpr std::size_t kMaxReason = 500;  // text of a stranger
        free_memory();
        throw refusal(received.contents.substr(0, kMaxReason), options_.advice);
      }
      case Message::kMemory: {
        constexpr std::size_t kMegabyte = 1'000'000;
        free_memory();
        throw refusal(
            fmt::format("its decoder needs more than {} MB of memory{}",
                        options_.memory_bytes / kMegabyte,
                        options_.wanted_memory_bytes == 0
                            ? ""
                            : fmt::format(", half of this machine's; up to {} MB are granted for "
                                          "pictures of this size where there is more",
                                          options_.wanted_memory_bytes / kMegabyte)),
            options_.wanted_memory_bytes == 0
                ? "The file is larger than memory allows, or damaged: make it smaller, or grant "
                  "more memory"
                : "The file is damaged, or needs a machine, or a control group, with more memory");
      }
      default:
        break;
    }
    throw refusal("its decoder returned damaged data", kIsDamaged);
  }

 private:
  /// Whether the decoder has sent a message without a request.
  bool has_message() const {
    pollfd waiting{child_.socket(), POLLIN, 0};
    return ::poll(&waiting, 1, 0) > 0;
  }
  /// Frees the pages of the shared memory, until the next request.
  bool free_memory() const { return ::ftruncate(child_.memory(), 0) == 0; }
  Error refusal(const std::string& why, const std::string& what_to_do) const {
    return Error::bad_input(fmt::format("the {} cannot be read: {}", options_.kind, why),
                            file_.string(), what_to_do);
  }
  /// A process that was stopped, or gets no time on a loaded machine, says nothing about the file.
  Error not_in_time() const {
    return Error::failed(
        fmt::format(
            "the {} was not read: its decoder did not answer within {} s and did not use the "
            "processor's time that it may use",
            options_.kind, longest_wait(options_).count()),
        file_.string(), "Try again when the machine has less to do");
  }
  void require_time() const {
    if (Clock::now() > deadline_) throw not_in_time();
    const auto time = child_.processor_time();
    if (time && *time - time_before_ > options_.time) {
      throw refusal(
          fmt::format("its decoder took more than {} s of processor time", options_.time.count()),
          kIsDamaged);
    }
  }
  /// Why the decoder has closed its end.
  Error ended() const {
    constexpr std::chrono::seconds kToEnd{1};
    const auto status = child_.wait_until(Clock::now() + kToEnd);
    if (!status)
      return refusal("its decoder closed its connection, or sent a message without a request",
                     kIsDamaged);
    if (WIFSIGNALED(*status)) {
      const int signal = WTERMSIG(*status);
      if (signal == SIGALRM) return not_in_time();  // its own clock, see set_timer()
      if (signal == SIGKILL) {
        return Error::failed(fmt::format("the decoder of a {} was killed", options_.kind),
                             file_.string(), "Free memory, and try again");
      }
      return refusal(fmt::format("its decoder crashed ({})", ::strsignal(signal)), kIsDamaged);
    }
    switch (WEXITSTATUS(*status)) {
      case kNoProc:
        return Error::failed(
            fmt::format("the {} cannot be read safely: /proc/self/statm cannot be read",
                        options_.kind),
            file_.string(), "Mount /proc");
      case kNoLimits:
        return cannot_start("its limits cannot be set", child_.program());
      case kNoFilter:
        return Error::failed(
            fmt::format("the {} cannot be read safely: the kernel has no filter of system calls "
                        "(seccomp)",
                        options_.kind),
            file_.string(),
            fmt::format(
                "Use a kernel with seccomp; if the file is trusted, add --unsandboxed or set "
                "{}=1",
                kUnsandboxedVariable));
      case kEnded:
      case kBroken:
        return refusal("its decoder ended", kIsDamaged);
      default:
        return cannot_start(fmt::format("exit code {}", WEXITSTATUS(*status)), child_.program());
    }
  }

  const DecoderOptions& options_;
  Child& child_;
  const fs::path& file_;
  Clock::time_point deadline_;
  std::chrono::nanoseconds time_before_;
  int messages_ = 0;
};

Confinement default_confinement() {
  const char* const value = std::getenv(kUnsandboxedVariable);
  return value != nullptr && std::string_view(value) == "1" ? Confinement::kLimitsOnly
                                                            : Confinement::kFull;
}

namespace {

/// Returns a copy of the descriptor, or none if it is not of a regular file.
FileDescriptor if_regular(const FileDescriptor& opened) {
  struct stat status {};
  const bool is_regular =
      opened.open() && ::fstat(opened.number(), &status) == 0 && S_ISREG(status.st_mode);
  return FileDescriptor(is_regular ? ::fcntl(opened.number(), F_DUPFD_CLOEXEC, 0) : -1);
}

}  // namespace

OpenFile only_file(const fs::path& file) {
  return [file](const std::string& name) {
    if (name != file.string()) return FileDescriptor(-1);
    return if_regular(FileDescriptor(::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK)));
  };
}

OpenFile only_file(const ContainedPath& file) {
  return [file](const std::string& name) {
    if (name != file.path().string()) return FileDescriptor(-1);
    return if_regular(open_contained_to_read(file));
  };
}

OpenFile files_below_folder_of(const fs::path& file, std::uint64_t max_bytes) {
  // Libraries may complete paths by the current folder.
  std::error_code no_current_folder;
  const fs::path complete = fs::absolute(file, no_current_folder).lexically_normal();
  return [file, complete, max_bytes](const std::string& name) {
    constexpr int kFlags = O_RDONLY | O_CLOEXEC | O_NONBLOCK;
    std::error_code unknown;
    const fs::path asked = fs::absolute(name, unknown).lexically_normal();
    if (name.empty() || unknown) return FileDescriptor(-1);
    const fs::path folder = complete.parent_path();
    const FileDescriptor opened =
        asked == complete ? FileDescriptor(::open(file.c_str(), kFlags))
                          : open_contained({folder, asked.lexically_relative(folder)}, kFlags);
    struct stat status {};
    const bool is_permitted = opened.open() && ::fstat(opened.number(), &status) == 0 &&
                              S_ISREG(status.st_mode) &&
                              static_cast<std::uint64_t>(status.st_size) <= max_bytes;
    return FileDescriptor(is_permitted ? ::fcntl(opened.number(), F_DUPFD_CLOEXEC, 0) : -1);
  };
}

DecoderProcess::DecoderProcess(DecoderOptions options) : options_(std::move(options)) {}
DecoderProcess::~DecoderProcess() = default;
DecoderProcess::DecoderProcess(DecoderProcess&&) noexcept = default;
DecoderProcess& DecoderProcess::operator=(DecoderProcess&&) noexcept = default;

void DecoderProcess::start() {
  if (!child_) child_ = std::make_unique<Child>(options_);
}

std::vector<std::byte> DecoderProcess::decode(std::span<const std::byte> request,
                                              const fs::path& file, const OpenFile& open_file) {
  start();
  // A decoder that did not answer in full has ended or must: its next answer would be this one's.
  std::unique_ptr<Child> child = std::move(child_);
  Exchange exchange(options_, *child, file);
  exchange.send_request(request);
  Received received;
  do {
    received = exchange.receive();
    if (received.kind == Message::kOpen) exchange.answer(open_file(received.contents));
  } while (received.kind == Message::kOpen);
  const bool goes_on = received.kind == Message::kRefusal || received.kind == Message::kMemory;
  if (goes_on) child_ = std::move(child);
  std::vector<std::byte> result = exchange.result_of(received);
  child_ = std::move(child);
  return result;
}

std::vector<std::byte> run_decoder(const DecoderOptions& options,
                                   std::span<const std::byte> request, const fs::path& file,
                                   const OpenFile& open_file) {
  return DecoderProcess(options).decode(request, file, open_file);
}

}  // namespace raystage::sandbox
