// SPDX-License-Identifier: Apache-2.0
// Internal to ingest/sources.
#pragma once

#include <filesystem>
#include <string>

#include "ingest/sources/ffmpeg_pointers.h"
#include "schemas/record_config.h"

namespace raystage::ingest {

/// The address that FFmpeg reads, and its input format.
struct FfmpegAddress {
  enum class Kind {
    kFile,         ///< has an end and waits for the reader
    kFilterGraph,  ///< generated pictures (lavfi) that are not in real time: waits as well
    kPipe,         ///< a file descriptor or named pipe: waits for the reader, may stall
    kNetwork,      ///< may stall and break
    kDevice        ///< an input device of libavdevice, or a filter graph in real time
  };
  Kind kind = Kind::kFile;
  std::string url;                        ///< in FFmpeg's syntax
  std::string display_url;                ///< for messages: without user name and password
  const AVInputFormat* format = nullptr;  ///< null: FFmpeg detects it
  bool may_redirect = false;              ///< to another host

  bool is_http() const {
    return kind == Kind::kNetwork && (url.starts_with("http://") || url.starts_with("https://"));
  }
  bool is_live() const { return kind == Kind::kNetwork || kind == Kind::kDevice; }
};

/// Resolves the address of `source`; relative files are in `base`. Loads libavdevice if the format
/// is not known without it. Throws Error (bad input) if FFmpeg has no such format or protocol.
FfmpegAddress resolve_ffmpeg_address(const schemas::RecordConfig::FfmpegSource& source,
                                     const std::filesystem::path& base);

/// Removes "user:password@" between "//" and the host.
std::string without_credentials(const std::string& url);

}  // namespace raystage::ingest
