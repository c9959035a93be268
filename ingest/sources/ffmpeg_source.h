// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>

#include "ingest/sources/frame_source.h"
#include "ingest/sources/source_permissions.h"
#include "schemas/record_config.h"

namespace raystage::ingest {

/// Opens the best video stream of anything that FFmpeg reads: devices, RTSP, HTTP, TCP, movies,
/// numbered images, raw video from a pipe. Motion JPEG is delivered byte for byte; other codecs are
/// decoded on the thread that calls next(). A stream that stalls yields kNoData, one that breaks
/// kLost, a file or pipe at its end kEnded. Display matrices (rotation) are ignored. Relative files
/// are in `base`. FFmpeg opens no other files and hosts than the source names
/// (ffmpeg_permissions.h). A frame larger than the source's limit is torn and empty. Throws Error
/// (bad input) if FFmpeg cannot open the source, may not, or does not know an option, Error
/// (failed) if no data arrives within 10 s.
std::unique_ptr<FrameSource> open_ffmpeg_source(const schemas::RecordConfig::FfmpegSource& source,
                                                const std::filesystem::path& base,
                                                SourcePermissions permissions = {});

/// Returns an upper estimate of FrameSource::memory_overhead() of a network camera that could not
/// be opened yet: what it sends first is received, too.
std::size_t memory_overhead_before_opening(const schemas::RecordConfig::FfmpegSource& source);

}  // namespace raystage::ingest
