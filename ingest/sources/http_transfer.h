// SPDX-License-Identifier: Apache-2.0
// Internal to ingest/sources.
#pragma once

#include <chrono>
#include <cstdint>
#include <exception>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "ingest/sources/http_options.h"
#include "ingest/sources/http_url.h"

struct curl_slist;  // of libcurl, whose header defines macros

namespace raystage::ingest {

/// Gets one URL at a time from a server, by libcurl on the caller's thread. It never follows a
/// redirection. It receives only while someone reads, so that a server that is faster than the
/// reader waits, and at most 1 MB waits here.
class HttpTransfer {
 public:
  /// What the server says before its data.
  struct Answer {
    std::string redirects_to;  ///< empty: it does not redirect
    std::string mime_type;
    std::int64_t start = 0;            ///< offset of the first byte that follows
    std::optional<std::int64_t> size;  ///< of the whole, bytes; none: unknown
    bool has_ranges = false;           ///< parts of it can be asked for
  };

  /// Calls `stop` about ten times per second, and stops once it returns true. `where` names the
  /// camera in errors. `options` must outlive this.
  HttpTransfer(const HttpOptions& options, std::function<bool()> stop, std::string where);
  ~HttpTransfer();
  HttpTransfer(const HttpTransfer&) = delete;
  HttpTransfer& operator=(const HttpTransfer&) = delete;

  /// Asks for `url` from byte `from`, and waits for the answer; ends what was read before.
  /// `trusted`: the server may receive the secrets of the options. Returns nothing if it was
  /// stopped or if no data came for the time in the options. Throws Error (bad input) if there is
  /// no connection, or if the server refuses, compresses its data or sends endless headers.
  std::optional<Answer> start(const HttpUrl& url, bool trusted, std::int64_t from);

  /// Waits for data and returns the number of bytes in `buffer`, or FFmpeg's code: AVERROR_EOF at
  /// the end, AVERROR_EXIT if it was stopped, AVERROR(ETIMEDOUT) after the time in the options.
  int read(std::uint8_t* buffer, int size);

 private:
  using Clock = std::chrono::steady_clock;
  // libcurl's handles are pointers to void.
  struct EasyDeleter {
    void operator()(void* easy) const;
  };
  struct MultiDeleter {
    void operator()(void* multi) const;
  };
  struct ListDeleter {
    void operator()(curl_slist* list) const;
  };

  static std::size_t on_header(char* text, std::size_t unit, std::size_t count, void* self);
  static std::size_t on_data(char* bytes, std::size_t unit, std::size_t count, void* self);
  static int on_socket(void* self, int socket, int purpose);
  void configure(const HttpUrl& url, bool trusted, std::int64_t from);
  void configure_secrets(const HttpUrl& url);
  void detach();
  void read_answer();
  std::string header(const char* name) const;
  std::size_t accept(const std::uint8_t* bytes, std::size_t count);
  int take_waiting(std::uint8_t* buffer, int size);
  int work();
  int error_code() const;
  std::string failure() const;

  const HttpOptions& options_;
  std::function<bool()> stop_;
  std::string where_;
  // libcurl demands that a transfer is gone before what it uses.
  std::vector<char> error_text_;
  std::unique_ptr<curl_slist, ListDeleter> headers_;
  std::unique_ptr<void, MultiDeleter> multi_;
  std::unique_ptr<void, EasyDeleter> easy_;

  bool attached_ = false, has_cookies_ = false;
  std::optional<Answer> answer_;
  std::exception_ptr refusal_;
  std::size_t header_bytes_ = 0;
  std::optional<int> result_;  ///< libcurl's code after the end
  bool paused_ = false;
  std::uint64_t received_ = 0;  ///< calls with headers or data
  std::uint8_t* target_ = nullptr;
  std::size_t target_size_ = 0, target_filled_ = 0;
  std::vector<std::uint8_t> waiting_;  ///< beyond what the reader asked for
  std::size_t waiting_taken_ = 0;
};

}  // namespace raystage::ingest
