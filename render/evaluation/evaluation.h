// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "render/common/image_quality.h"
#include "render/evaluation/shot_errors.h"
#include "schemas/hole_fill.h"
#include "schemas/option_values.h"
#include "schemas/views_document.h"
#include "store/processing/frames/blend_space.h"
#include "store/take.h"

namespace raystage {

/// A view as it was rendered, and what is true there.
struct EvaluatedView {
  std::size_t index, count;  ///< which of how many views
  const std::string& id;
  const RgbImage& image;
  const RgbImage& truth;
  std::span<const std::uint8_t> covered;  ///< 1 per pixel that counts
};

struct EvaluationSettings {
  std::string method = "focal_plane";
  OptionValues options;  ///< of the method
  /// Metres in front of the array, parallel to it; nullopt: eq. 2.2 from the take's depth range.
  std::optional<double> focal_depth;
  /// Ids of cameras that do not contribute; each of their frames that the timeline takes becomes a
  /// view with itself as truth: where their lens distorts, both without distortion
  /// (undistorted_ground_truth()), so that times are those of the fast ways.
  std::vector<std::string> excluded_camera_ids;
  /// Every n-th row and column of the grid contributes, counted from the first: fewer cameras.
  int camera_step = 1;
  HoleFill fill = HoleFill::kNone;  ///< when not none, all pixels are measured
  int view_step = 1;                ///< every n-th view is rendered, from the first
  /// Renderings of each view that are timed after the first one, with frames decoded and what the
  /// method keeps at hand; at most as many as take 2 s. 0: the first one's times are reported.
  int repeat = 0;
  bool count_needed_pixels = true;  ///< renders each view once more, to count
  BlendSpace blend_space = BlendSpace::kPerceptual;
  /// As RendererSettings: false measures what is derived anew. Not used with cameras left out.
  bool use_take_folder = true;
  std::filesystem::path image_folder;        ///< rendered views as PNG go here; empty: nowhere
  std::size_t memory_bytes = 4'000'000'000;  ///< shared out by split_memory_budget()
  std::function<void(const EvaluatedView&)> on_view;  ///< sees every view; may be empty
};

/// The cost and the error of one view.
struct ViewEvaluation {
  std::string id;
  ImageQuality quality;
  double decode_ms = 0;  ///< wall clock, nothing cached before
  /// Wall clock without decoding: the median of the repeated renderings, else the first one's.
  double render_ms = 0;
  double min_render_ms = 0;  ///< the shortest of them
  /// What the method worked out in this view and kept for others, wall clock; measured only where
  /// renderings are repeated, otherwise part of `render_ms`.
  double prepare_ms = 0;
  double working_mb = 0;  ///< RenderStatistics::working_bytes, in 10^6 bytes
  /// Source pixels entropy-decoded per distinct pixel sampled; not-a-number where none was.
  double decoded_per_needed = std::numeric_limits<double>::quiet_NaN();
};

/// How PSNR goes along the views in their order, where it is finite.
struct TemporalStability {
  double stddev_db = 0;    ///< standard deviation over the views
  double max_step_db = 0;  ///< from one view of a shot (shot_of_view()) to its next, absolute
};

struct Evaluation {
  std::string take, method;
  OptionValues options;    ///< of the method, all of them: given or as they are unless given
  double focal_depth = 0;  ///< metres
  int cameras = 0;         ///< that could contribute
  std::vector<ViewEvaluation> views;
  ViewEvaluation mean;  ///< over the views that cover anything
  TemporalStability temporal_stability;
  std::vector<ShotStability> shots;  ///< of two views and more
  double prepare_ms = 0;  ///< mean over the views that had anything to prepare: once an instant
  /// How many views lie outside the take's time, and of the views (RenderedView::notes), each once.
  std::vector<std::string> notes;
};

TemporalStability measure_temporal_stability(std::span<const ViewEvaluation> views);

/// Indices of the take's cameras that do not contribute. Throws Error (bad input): an id that the
/// take does not have; a camera without a place in a grid, with a step above 1.
std::vector<int> excluded_camera_indices(const Take& take,
                                         const std::vector<std::string>& excluded_camera_ids,
                                         int camera_step);

/// Renders every view at its instant (see make_evaluation_cases()) and compares it with its truth
/// image. `views` may be empty if cameras are left out. Throws Error (bad input): unknown camera,
/// no depth range for the best plane, unreadable truth, a truth image of another size, a timeline
/// that is damaged or not of this take, no view within the take's time.
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
