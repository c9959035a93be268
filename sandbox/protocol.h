// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

namespace raystage::sandbox {

/// File descriptors that a decoder's program starts with.
inline constexpr int kRequestSocket = 3;  ///< SOCK_SEQPACKET: a name there, a file or none back
inline constexpr int kResultFile = 4;     ///< memory that receives the result or an error's text

/// Longest name of a file, bytes.
inline constexpr std::size_t kMaxName = 4096;

/// The answer to a name: one byte; with kOpened a file descriptor comes along.
enum class Answer : char { kNone = 0, kOpened = 1 };

/// Exit codes of a decoder's program.
enum DecoderExit {
  kDecoded = 0,   ///< the result is complete
  kRefused = 1,   ///< the file cannot be decoded; the result is the reason
  kNoFilter = 2,  ///< the kernel offers no filter of system calls
  kMemoryExceeded = 3,
  kNoLimits = 4  ///< of memory, time and files
};

}  // namespace raystage::sandbox
