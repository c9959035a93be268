// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>

#include "ingest/sources/frame_source.h"
#include "schemas/record_config.h"

namespace raystage {

/// Frames of the first video stream of anything that FFmpeg opens: devices, RTSP, HTTP, TCP,
/// movies, numbered images, raw video from a pipe. Motion JPEG comes out byte for byte; all else is
/// decoded on the reader's thread. A stream that stalls yields kNoData; one that breaks, kLost; a
/// file or pipe that is read to its end, kEnded. Pictures are not turned by display matrices.
///
/// `base`: the folder of relative files. Throws Error: bad input for what FFmpeg cannot open and
/// for options that it does not know; failed where nothing comes within 10 seconds.
std::unique_ptr<FrameSource> open_ffmpeg_source(const RecordConfig::FfmpegSource& source,
                                                const std::filesystem::path& base);

}  // namespace raystage
