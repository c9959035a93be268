// SPDX-License-Identifier: Apache-2.0
// Inside ingest/sources only.
#pragma once

#include <functional>
#include <string>

#include "ingest/sources/ffmpeg_pointers.h"

namespace raystage {

/// Feeds FFmpeg from a file descriptor or a named pipe. FFmpeg's own reader of pipes cannot be
/// interrupted while the other end is silent.
class PipeReader {
 public:
  /// `url`: "pipe:N" (a duplicate of descriptor N is read) or "file:PATH". Throws Error (bad input)
  /// where it cannot be opened. `stop` is asked about ten times a second while nothing comes.
  PipeReader(const std::string& url, std::function<bool()> stop);
  ~PipeReader();
  PipeReader(const PipeReader&) = delete;
  PipeReader& operator=(const PipeReader&) = delete;

  AVIOContext* context() { return context_; }

 private:
  static int read(void* self, std::uint8_t* buffer, int size);

  std::function<bool()> stop_;
  int descriptor_ = -1;
  AVIOContext* context_ = nullptr;
};

}  // namespace raystage
