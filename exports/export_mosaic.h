// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <stop_token>
#include <vector>

#include "exports/export_report.h"
#include "exports/frame_choice.h"
#include "exports/movie_codec.h"
#include "exports/output_folder.h"
#include "rig/rig.h"
#include "store/take.h"

namespace raystage::exports {

struct MosaicExportOptions {
  std::filesystem::path output;                    ///< a movie; its extension selects the container
  FrameChoiceOptions frames;                       ///< with kConstant
  const MovieCodec* codec = &movie_codec("h264");  ///< not one that copies JPEG
  int tile_width = 320;  ///< pixels, 16 to 4096; the height follows from the first camera's shape
  int columns = 0;       ///< 0: as the rig's grid if it is one, or else nearly square
  ExistingFiles existing = ExistingFiles::kError;
  ExportProgress progress = [](double) {};
  bool is_valid(std::string* reason) const;
};

/// Where the cameras are in a mosaic, in tiles.
struct MosaicLayout {
  int columns = 1, rows = 1;
  struct Position {
    int column = 0, row = 0;
  };
  std::vector<Position> positions;  ///< of each camera
};

/// Returns the layout of cameras of a rig: their rows and columns in the grid, without those that
/// are empty, if each has a place of its own and `columns` is 0; otherwise in their order, row by
/// row.
MosaicLayout mosaic_layout(const rig::Rig& rig, const std::vector<int>& cameras, int columns);

/// Writes all cameras side by side into one movie, a frame per tick. Throws Error.
ExportReport export_mosaic(const store::Take& take, const MosaicExportOptions& options,
                           const std::stop_token& stop);

}  // namespace raystage::exports
