// SPDX-License-Identifier: Apache-2.0
// Inside ingest/sources only.
#pragma once

#include <filesystem>
#include <string>

#include "ingest/sources/ffmpeg_pointers.h"
#include "schemas/record_config.h"

namespace raystage {

/// Where FFmpeg shall read, and by which of its input formats.
struct FfmpegAddress {
  enum class Kind {
    kFile,         ///< has an end and waits for us
    kFilterGraph,  ///< FFmpeg's own pictures (lavfi) that keep no real time: wait for us too
    kPipe,         ///< a file descriptor or named pipe: waits for us, and may stall
    kNetwork,      ///< may stall and break
    kDevice        ///< an input device of libavdevice
  };
  Kind kind = Kind::kFile;
  std::string url;                        ///< as FFmpeg wants it
  std::string display_url;                ///< for people: without user name and password
  const AVInputFormat* format = nullptr;  ///< null: FFmpeg finds out

  bool is_live() const { return kind == Kind::kNetwork || kind == Kind::kDevice; }
};

/// Relative files are looked up in `base`. Loads libavdevice where a format is asked for that
/// nobody else knows. Throws Error (bad input) where FFmpeg knows no such format or protocol.
FfmpegAddress resolve_ffmpeg_address(const RecordConfig::FfmpegSource& source,
                                     const std::filesystem::path& base);

}  // namespace raystage
