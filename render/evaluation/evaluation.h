// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <limits>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "render/quality/image_quality.h"
#include "schemas/hole_fill.h"
#include "schemas/option_values.h"
#include "schemas/views.h"
#include "store/frames/blend_space.h"
#include "store/take.h"

namespace raystage {

struct EvaluationSettings {
  std::string method = "focal_plane";
  OptionValues options;  ///< of the method
  /// Metres in front of the array, parallel to it; nullopt: eq. 2.2 from the take's depth range.
  std::optional<double> focal_depth;
  /// Ids of cameras that do not contribute; each of their frames becomes a view with itself as
  /// truth.
  std::vector<std::string> leave_out;
  /// Every n-th row and column of the grid contributes, counted from the first: fewer cameras.
  int camera_step = 1;
  HoleFill fill = HoleFill::kNone;  ///< when not none, all pixels are measured
  BlendSpace blend_space = BlendSpace::kPerceptual;
  std::filesystem::path image_folder;  ///< rendered views as PNG go here; empty: nowhere
  std::size_t cache_bytes = std::size_t{1} << 30;
};

/// What one view cost and how wrong it was.
struct ViewEvaluation {
  std::string id;
  ImageQuality quality;
  double decode_ms = 0, render_ms = 0;  ///< wall clock, nothing cached before
  /// Source pixels entropy-decoded per distinct pixel sampled; not-a-number where none was.
  double decoded_per_needed = std::numeric_limits<double>::quiet_NaN();
};

struct Evaluation {
  std::string take, method;
  double focal_depth = 0;  ///< metres
  int cameras = 0;         ///< that could contribute
  std::vector<ViewEvaluation> views;
  ViewEvaluation mean;  ///< over the views that cover anything
};

/// Renders every view at its time (each camera's nearest frame within half a frame time) and
/// compares it with its truth image. `views` may be empty if cameras are left out.
/// Throws Error (bad input): unknown camera, no depth range for the best plane, unreadable truth,
/// a truth image of another size.
Evaluation evaluate_views(const Take& take, const ViewsDocument& views,
                          const std::filesystem::path& views_folder,
                          const EvaluationSettings& settings,
                          const std::function<void(double)>& progress, std::stop_token stop);

/// schema "raystage/evaluation/1", documented in docs/formats/evaluation.md.
std::string evaluation_as_json(const Evaluation& evaluation);
/// A table for a person: a line per view and the mean.
std::string evaluation_as_text(const Evaluation& evaluation);
/// One row of a Markdown table, and its two heading lines.
std::string evaluation_table_heading();
std::string evaluation_table_row(const Evaluation& evaluation, const std::string& label);

}  // namespace raystage
