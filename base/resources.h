// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string>

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

/// Returns the CPU time (user and system) that this process has used so far, in seconds.
double cpu_seconds();

/// Resets peak_memory() to the present resident set size. Returns whether the kernel allows it.
bool reset_peak_memory();

}  // namespace raystage
