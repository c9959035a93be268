// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "compose/preview/display.h"

namespace raystage {

/// What to make of a sequence of EXR files.
struct PreviewOptions {
  std::string sequence;                    ///< SequenceName pattern
  std::optional<std::vector<int>> frames;  ///< sorted; none: every file there is
  std::filesystem::path movie;             ///< may be empty
  std::string pictures;                    ///< SequenceName pattern of .png; may be empty
  std::filesystem::path contact_sheet;     ///< PNG; may be empty
  int sheet_frames = 16, sheet_columns = 4;
  int thumbnail_width = 400;  ///< pixels, at most
  std::optional<double> fps;  ///< of the movie; none: as the files say, every frame of a
                              ///< sequence with steps shown that much longer
  bool hold_missing = false;  ///< show the frame before in place of one that is not there
  bool burn_in = false;       ///< frame numbers and time codes in the movie and the pictures
  DisplaySettings display;
  std::function<void(double)> progress = [](double) {};
};

struct PreviewReport {
  int frames = 0, held = 0;
  double fps = 0;
  std::string encoder;  ///< empty without a movie
  bool stopped = false;
};

/// Throws Error: bad input where frames are missing (unless held), damaged or of different sizes,
/// failed where the results cannot be written. Each file appears whole or not at all.
PreviewReport make_preview(const PreviewOptions& options, std::stop_token stop);

/// The files of a sequence that exist, as frame numbers in rising order.
std::vector<int> existing_frames(const std::string& sequence);

}  // namespace raystage
