// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>
#include <string>

#include "base/posix_file.h"

namespace raystage {

/// Returns the name of this machine, or "unknown".
std::string host_name();

/// Returns the number of threads that this process may keep busy, at least 1: its CPU affinity,
/// limited by the CPU quota of its control group (cgroup v2). Slurm and containers set either.
int available_threads();

/// Returns the memory this process may use, in bytes: the machine's, limited by its control group.
std::size_t available_memory();

/// Returns the memory, in bytes, that this process could allocate now without swapping: the
/// machine's free memory including page cache, or the rest of its control group's limit.
std::size_t free_memory();

/// Returns the peak resident set size of this process so far, in bytes.
std::size_t peak_memory();

/// Returns the largest resident set size of this process since it was started, in bytes (VmHWM).
/// Unlike peak_memory() it excludes that of the program that started it. 0 if unknown.
std::size_t peak_resident_memory();

/// Returns the smallest limit of memory (memory.max and memory.high) of this process's control
/// groups (cgroup v2), in bytes; nullopt without a limit.
std::optional<std::size_t> control_group_memory();

/// The memory of this process at one time, in bytes.
struct MemoryUse {
  std::size_t resident = 0;  ///< in RAM, with libraries and mapped files
  std::size_t data = 0;      ///< allocated, used or not: what RLIMIT_DATA limits
};

/// Reads the memory of this process repeatedly, without allocating any.
class MemoryUseReader {
 public:
  MemoryUseReader();
  /// Returns nullopt where there is no /proc.
  std::optional<MemoryUse> read() const;

 private:
  FileDescriptor file_;
};

/// Returns the CPU time (user and system) that this process has used so far, in seconds.
double cpu_seconds();

/// Resets peak_memory() to the present resident set size. Returns whether the kernel allows it.
bool reset_peak_memory();

}  // namespace raystage
