// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "base/run_status.h"
#include "compose/preview/frame_pictures.h"

namespace raystage::compose {

/// What to make from sequences of EXR files.
struct PreviewOptions {
  FramePictureOptions pictures_of;         ///< sequences, and what is shown of them
  std::optional<std::vector<int>> frames;  ///< sorted; none: all files of the first sequence
  std::filesystem::path movie;             ///< may be empty
  std::string pictures;                    ///< SequenceName pattern of .png; may be empty
  std::filesystem::path contact_sheet;     ///< PNG; may be empty
  int sheet_frames = 16, sheet_columns = 4;
  int thumbnail_width = 400;  ///< pixels, at most
  /// Of the movie; none: that of the files, where each frame of a sequence with steps is shown for
  /// the whole step.
  std::optional<double> fps;
  bool hold_missing = false;  ///< repeat the previous frame for a missing one
  bool burn_in = false;       ///< frame numbers and time codes in the movie and the pictures
  std::function<void(double)> progress = [](double) {};
  bool is_valid(std::string* reason) const;
};

struct PreviewReport {
  int frames = 0, held = 0;
  double fps = 0;
  std::string encoder;  ///< empty without a movie
  std::string range;    ///< as FramePictures::range_text()
  RunStatus status = RunStatus::kNotRun;
};

/// Makes the previews. Each file is written whole or not at all. Throws Error: bad input if frames
/// are missing (unless held), damaged or of different sizes, failed if files cannot be written.
PreviewReport make_preview(const PreviewOptions& options, std::stop_token stop);

/// Returns the frame numbers of a sequence's existing files, ascending.
std::vector<int> existing_frames(const std::string& sequence);

}  // namespace raystage::compose
