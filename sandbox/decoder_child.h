// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/types.h>

#include <chrono>
#include <filesystem>
#include <optional>
#include <string>

#include "base/error.h"
#include "base/posix_file.h"
#include "sandbox/decoder_process.h"

namespace raystage::sandbox {

/// The process of a decoder with its socket and its shared memory; killed and waited for on
/// destruction.
class DecoderProcess::Child {
 public:
  /// Throws Error (failed) if the process cannot be started.
  explicit Child(const DecoderOptions& options);
  ~Child();
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

  const std::filesystem::path& program() const { return program_; }
  int socket() const { return socket_.number(); }
  int memory() const { return memory_.number(); }
  /// Time of the processor so far; nullopt if the process has ended.
  std::optional<std::chrono::nanoseconds> processor_time() const;
  /// Waits for the end and returns waitpid()'s status, or nullopt if it does not come in time.
  std::optional<int> wait_until(std::chrono::steady_clock::time_point deadline);

 private:
  std::filesystem::path program_;
  FileDescriptor socket_, memory_;
  pid_t id_ = 0;

  Child(const DecoderOptions& options, std::array<int, 2> sockets);
};

Error cannot_start(const std::string& reason, const std::filesystem::path& program);

/// By the clock, a request may take much longer than its time of the processor, which others may
/// use.
std::chrono::seconds longest_wait(const DecoderOptions& options);

}  // namespace raystage::sandbox
