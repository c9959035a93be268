// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <stop_token>
#include <string>

#include "exports/export_report.h"
#include "exports/frame_choice.h"
#include "exports/movie_codec.h"
#include "store/take.h"

namespace raystage::exports {

struct MovieExportOptions {
  std::filesystem::path output;  ///< folder; must not exist
  FrameChoiceOptions frames;
  const MovieCodec* codec = &movie_codec("copy");
  std::string extension = {};  ///< of the container, e.g. ".mkv"; empty: the codec's default
  ExportProgress progress = [](double) {};
};

/// Writes a movie per camera (CAMERA.mov), frames.csv with the time of each frame, and rig.json.
/// Cameras are written in parallel; the bytes do not depend on the number of threads. The folder
/// appears when it is complete. With kConstant times all movies have the same frames. A camera
/// without frames has no movie, and a note. Throws Error.
ExportReport export_movies(const store::Take& take, const MovieExportOptions& options,
                           const std::stop_token& stop);

}  // namespace raystage::exports
