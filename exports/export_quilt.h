// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/run_status.h"
#include "exports/export_report.h"
#include "exports/movie_codec.h"
#include "exports/output_folder.h"

namespace raystage::exports {

/// The views of a quilt, for autostereoscopic displays (Looking Glass): from a row of virtual
/// cameras about that of the shot, parallel, with a common picture of the screen's plane.
struct QuiltExportOptions {
  std::filesystem::path input;   ///< a take (folder) or a shot (file)
  std::filesystem::path output;  ///< .png, with a frame token for several frames, or a movie
  int columns = 8, rows = 6;     ///< of views, 1 to 64
  int view_width = 420;          ///< pixels, 16 to 8192
  /// Width / height of a view and of the display; 0: the shot's. A narrower view shows the shot's
  /// height, a wider one its width.
  double aspect = 0;
  /// Distance of the plane that appears in the screen, metres; none: the shot's focus distance.
  std::optional<double> screen_m = {};
  /// Distance from the first to the last virtual camera, metres; none: 0.9 times the extent of the
  /// array along the row. At its edge, half of a view has no cameras.
  std::optional<double> baseline_m = {};
  /// Views are the frames of this row of the array's own cameras, rectified, instead of rendered
  /// ones: only of takes. There are as many views as cameras; if columns * rows is another number,
  /// they are in one row.
  std::optional<int> array_row = {};
  std::string method = {};                         ///< of all takes; empty: the shot's
  std::optional<std::vector<int>> frames = {};     ///< sorted; none: the first one, movies: all
  const MovieCodec* codec = &movie_codec("h264");  ///< of movies
  ExistingFiles existing = ExistingFiles::kError;
  ExportProgress progress = [](double) {};
  bool is_valid(std::string* reason) const;
};

struct QuiltReport {
  std::string files;  ///< path or pattern of what was written
  int frames = 0, views = 0;
  int held = 0;               ///< frames for which a take shows its nearest instant
  int black = 0;              ///< frames with black views: a camera of the row has no frame
  int width = 0, height = 0;  ///< of the quilt, pixels
  double screen_m = 0, baseline_m = 0;
  double least_covered_share = 1;  ///< of a view's pixels that cameras saw, the least of all views
  int rotten = 0;                  ///< frames that lack cameras with rotten frames
  RunStatus status = RunStatus::kNotRun;
  ExitCode exit_code() const;
};

/// Returns the name with "_qsCxRaASPECT" before the extension, by which Looking Glass's programs
/// know the layout: "shot_qs8x6a0.75.png".
std::filesystem::path quilt_name(const std::filesystem::path& file, int columns, int rows,
                                 double aspect);

/// Renders the views and writes quilts: the leftmost view is at the lower left, the views follow to
/// the right, then upwards. Each file is written whole or not at all. Throws Error.
QuiltReport export_quilt(const QuiltExportOptions& options, const std::stop_token& stop);

}  // namespace raystage::exports
