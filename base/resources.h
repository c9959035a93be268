// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

namespace raystage {

/// Threads this process may keep busy: its CPU affinity, cut by the CPU quota of its control group
/// (cgroup version 2), at least 1. Slurm and containers set the one or the other.
int available_threads();

/// Bytes of memory this process may use: the machine's, cut by the limit of its control group.
std::size_t available_memory();

/// Bytes of memory that this process could take at this moment without swapping: what the machine
/// has free, page cache included, or what is left of the limit of its control group.
std::size_t free_memory();

/// Largest resident size of this process so far, bytes.
std::size_t peak_memory();

/// Processor time that this process has used so far, seconds.
double cpu_seconds();

/// Lets peak_memory() count from what the process holds now. Says whether the kernel allows it.
bool reset_peak_memory();

}  // namespace raystage
