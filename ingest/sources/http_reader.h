// SPDX-License-Identifier: Apache-2.0
// Internal to ingest/sources.
#pragma once

#include <exception>
#include <functional>
#include <string>

#include "ingest/sources/ffmpeg_address.h"
#include "ingest/sources/ffmpeg_pointers.h"
#include "ingest/sources/http_options.h"
#include "ingest/sources/http_transfer.h"
#include "ingest/sources/http_url.h"

namespace raystage::ingest {

/// Feeds FFmpeg from a camera or movie behind http or https. FFmpeg's own reader follows every
/// redirection, so that a camera could make it send requests to any host; this one checks each
/// before it is followed. FFmpeg finds the MIME type as with its own reader, and can seek if the
/// server has ranges.
class HttpReader {
 public:
  /// Takes the options of http out of `options`, connects and waits for the answer. Calls `stop`
  /// about ten times per second while no data comes. Throws Error (bad input) if the server cannot
  /// be reached, refuses or redirects elsewhere, Error (failed) if it does not answer in time.
  HttpReader(const FfmpegAddress& address, FfmpegOptions& options, std::function<bool()> stop);
  ~HttpReader();
  HttpReader(const HttpReader&) = delete;
  HttpReader& operator=(const HttpReader&) = delete;

  AVIOContext* context() { return context_; }
  /// Throws what a failed seek could not throw through FFmpeg, if there is any.
  void rethrow_failure() const;
  /// Returns what it would throw, as a text; empty: nothing.
  std::string failure() const;

 private:
  static int read(void* self, std::uint8_t* buffer, int size);
  static std::int64_t seek(void* self, std::int64_t offset, int whence);
  static void* next_child(void* context, void* previous);
  bool open(std::int64_t from);
  std::int64_t seek_to(std::int64_t offset, int whence);

  std::string where_;
  HttpUrl::RedirectLimits limits_;
  HttpOptions options_;
  HttpUrl url_;          ///< after redirections
  bool trusted_ = true;  ///< no redirection led to another server
  HttpTransfer transfer_;
  HttpTransfer::Answer answer_;
  std::int64_t position_ = 0;
  bool is_open_ = false;
  std::exception_ptr failure_;
  AVIOContext* context_ = nullptr;
};

}  // namespace raystage::ingest
