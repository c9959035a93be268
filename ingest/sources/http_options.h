// SPDX-License-Identifier: Apache-2.0
// Internal to ingest/sources.
#pragma once

#include <cstdint>

#include "ingest/sources/ffmpeg_pointers.h"

namespace raystage::ingest {

/// The options of a camera behind http or https, under the names and with the values of FFmpeg's
/// protocols http, tls and tcp. An object of FFmpeg's option system, so that values are read as
/// FFmpeg reads them, and that demuxers find the MIME type in it.
class HttpOptions {
 public:
  /// Takes the options that it knows out of `options`. Throws Error (bad input) if a value is
  /// impossible or an option of FFmpeg's protocol is not supported. `where` names the camera.
  HttpOptions(FfmpegOptions& options, const std::string& where);
  ~HttpOptions();
  HttpOptions(const HttpOptions&) = delete;
  HttpOptions& operator=(const HttpOptions&) = delete;

  /// The fields that FFmpeg's option system reads and writes by their offset.
  struct Fields {
    const AVClass* av_class = nullptr;  // first, as FFmpeg demands
    char* user_agent = nullptr;
    char* headers = nullptr;  ///< lines "NAME: VALUE"
    char* referer = nullptr;
    char* cookies = nullptr;     ///< lines as of Set-Cookie
    char* http_proxy = nullptr;  ///< the environment's proxies are not used
    char* ca_file = nullptr;
    char* cert_file = nullptr;
    char* key_file = nullptr;
    // Of the answer: for demuxers to read, not for users to set.
    char* mime_type = nullptr;
    char* location = nullptr;  ///< URL after redirections
    std::int64_t timeout = 0;  ///< microseconds without data; 0: none
    std::int64_t rw_timeout = 0;
    int tls_verify = 0;
    int basic_at_once = 0;  ///< send the password before the camera asks for it
    int max_redirects = 0;
    int seekable = -1;             ///< -1: as the server says
    int receive_buffer_size = -1;  ///< bytes of the socket; -1: the system's default
  };
  const Fields& operator*() const { return fields_; }
  const Fields* operator->() const { return &fields_; }

  void set_answer(const std::string& mime_type, const std::string& location);
  /// For FFmpeg: the object with the options "mime_type" and "location".
  void* object() { return &fields_; }

 private:
  Fields fields_;
};

}  // namespace raystage::ingest
