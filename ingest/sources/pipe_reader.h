// SPDX-License-Identifier: Apache-2.0
// Internal to ingest/sources.
#pragma once

#include <functional>
#include <string>

#include "ingest/sources/ffmpeg_pointers.h"

namespace raystage::ingest {

/// Feeds FFmpeg from a file descriptor or a named pipe. FFmpeg's own pipe reader cannot be
/// interrupted while the writer is silent.
class PipeReader {
 public:
  /// Opens `url`: "pipe:N" (a duplicate of descriptor N) or "file:PATH". Calls `stop` about ten
  /// times per second while no data comes. Throws Error (bad input) if the pipe cannot be opened.
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

}  // namespace raystage::ingest
