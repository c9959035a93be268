// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

namespace raystage::sandbox {

/// File descriptors that a decoder's program starts with.
inline constexpr int kSocket = 3;        ///< SOCK_SEQPACKET: messages, each starts with its kind
inline constexpr int kSharedMemory = 4;  ///< a file in memory: holds large requests, then results

/// Kinds of messages.
enum class Message : char {
  kRequest = 'Q',       ///< to the decoder; the request follows, at most kMaxText bytes
  kLargeRequest = 'L',  ///< to the decoder; a std::uint64_t follows: bytes of the request in memory
  kResult = 'R',        ///< to the parent; a std::uint64_t follows: bytes of the result
  kRefusal = 'E',       ///< to the parent; the reason follows, at most kMaxText bytes
  kMemory = 'M',        ///< to the parent: the request needs more memory than there is
  kOpen = 'O',          ///< to the parent; the name of a file follows, at most kMaxText bytes
  kOpened = 'F',        ///< to the decoder, with a file descriptor
  kNotOpened = 'N'
};

/// Longest name of a file and longest reason, bytes.
inline constexpr std::size_t kMaxText = 4096;

/// Exit codes of a decoder's program.
enum DecoderExit {
  kEnded = 0,     ///< the parent has no more requests
  kNoFilter = 2,  ///< the kernel offers no filter of system calls
  kNoProc = 3,    ///< /proc/self/statm cannot be read
  kNoLimits = 4,  ///< of memory, time and files
  kBroken = 5     ///< the parent sent no request
};

}  // namespace raystage::sandbox
