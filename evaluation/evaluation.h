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

#include "evaluation/light_errors.h"
#include "evaluation/region_errors.h"
#include "evaluation/shot_errors.h"
#include "render/common/image_quality.h"
#include "schemas/hole_fill.h"
#include "schemas/option_values.h"
#include "schemas/views_document.h"
#include "store/processing/frames/blend_space.h"
#include "store/take.h"

namespace raystage::evaluation {

struct EvaluatedView {
  std::size_t index, count;  ///< index of the view, and number of views
  const std::string& id;
  const store::RgbImage& image;
  const store::RgbImage& truth;
  std::span<const std::uint8_t> covered;  ///< 1 per pixel that counts
  const TruthRegions* regions = nullptr;  ///< null if the true depths are unknown
};

struct EvaluationOptions {
  std::string method = "focal_plane";
  schemas::OptionValues options;  ///< of the method
  /// Metres in front of the array, parallel to it; nullopt: eq. 2.2 from the take's depth range.
  std::optional<double> focal_depth;
  /// Ids of cameras that do not contribute. Each of their frames in the timeline is the truth of a
  /// view. For a lens with distortion, view and truth are undistorted (undistorted_ground_truth()),
  /// so that times are those of the fast renderers.
  std::vector<std::string> excluded_camera_ids;
  /// Every n-th row and column of the camera grid contributes, from the first on.
  int camera_step = 1;
  /// Interpolates the pictures of the cameras at the time of each view, as `"time": "exact"` of a
  /// shot's layer; needs a timeline.
  bool exact_times = false;
  schemas::HoleFill fill = schemas::HoleFill::kNone;  ///< if not none, all pixels are measured
  int view_step = 1;  ///< every n-th view is rendered, from the first on
  /// Timed renderings of each view after the first, with decoded frames and a filled result cache.
  /// At most as many as take 2 s; 0: report the times of the first.
  int repeat = 0;
  bool count_needed_pixels = true;  ///< renders each view once more to count
  store::BlendSpace blend_space = store::BlendSpace::kPerceptual;
  /// As RendererOptions; false measures new computations. Ignored if cameras are excluded.
  bool use_take_folder = true;
  std::filesystem::path image_folder;                 ///< for rendered views as PNG; empty: none
  std::size_t memory_bytes = 4'000'000'000;           ///< divided by split_memory_budget()
  std::function<void(const EvaluatedView&)> on_view;  ///< called for every view; may be empty
  bool is_valid(std::string* reason) const;
};

struct ViewEvaluation {
  std::string id;
  render::ImageQuality quality;
  double decode_ms = 0;  ///< wall clock, with empty caches
  /// Wall clock without decoding: the median of the repeated renderings, else of the first one.
  double render_ms = 0;
  double min_render_ms = 0;  ///< the shortest of them
  /// Wall clock of results that the method caches for other views. Measured only with repeated
  /// renderings, otherwise part of `render_ms`.
  double prepare_ms = 0;
  double working_mb = 0;  ///< RenderStatistics::working_bytes, in 10^6 bytes
  /// Source pixels entropy-decoded per distinct pixel sampled; NaN if none was sampled.
  double decoded_per_needed = std::numeric_limits<double>::quiet_NaN();
  std::optional<RegionErrors> regions = {};  ///< if the true depths are known
  std::optional<LightErrors> light = {};     ///< if the true linear light is known
};

/// The variation of finite PSNR over the views in their order.
struct TemporalStability {
  double stddev_db = 0;    ///< standard deviation over the views
  double max_step_db = 0;  ///< largest change from a view of a shot (shot_of_view()) to its next
};

struct Evaluation {
  std::string take, method;
  schemas::OptionValues options;  ///< all options of the method, default or given
  double focal_depth = 0;         ///< metres
  bool exact_times = false;       ///< as EvaluationOptions
  int cameras = 0;                ///< that may contribute
  std::vector<ViewEvaluation> views;
  ViewEvaluation mean;  ///< over the views with covered pixels
  TemporalStability temporal_stability;
  std::vector<ShotStability> shots;  ///< with at least two views
  double prepare_ms = 0;             ///< mean over the views that prepared an instant
  /// Number of views outside the take's time; notes of the views (RenderedView::notes), each once.
  std::vector<std::string> notes;
  /// Whether stored frames are rotten: views with a rotten truth are left out, cameras with rotten
  /// frames are absent from the others; the notes name them.
  bool has_rot = false;
};

TemporalStability measure_temporal_stability(std::span<const ViewEvaluation> views);

/// Returns the indices of the take's cameras that do not contribute. Throws Error (bad input) for
/// an id that the take does not have, and for a camera without grid position if the step is above
/// 1.
std::vector<int> excluded_camera_indices(const store::Take& take,
                                         const std::vector<std::string>& excluded_camera_ids,
                                         int camera_step);

/// Renders every view at its instant (see make_evaluation_cases()) and compares it with its truth
/// image. Views whose truth is a rotten frame are left out, see Evaluation::has_rot; Error (bad
/// input) if no view remains. `views` may be empty if cameras are excluded. Throws Error (bad
/// input) for an unknown camera, an optimal focal plane without a depth range, and a truth image
/// that is unreadable or of another size. It does so, too, for a timeline that is damaged or of
/// another take, and if no view is within the take's time.
Evaluation evaluate_views(const store::Take& take, const schemas::ViewsDocument& views,
                          const std::filesystem::path& views_folder,
                          const EvaluationOptions& settings,
                          const std::function<void(double)>& progress, std::stop_token stop);

/// Returns schema "raystage/evaluation/1", documented in docs/formats/evaluation.md.
std::string evaluation_as_json(const Evaluation& evaluation);
/// Returns a table for the terminal: a line per view and the mean.
std::string evaluation_as_text(const Evaluation& evaluation);
/// Return the two heading lines and a row of a Markdown table.
std::string evaluation_table_heading();
std::string evaluation_table_row(const Evaluation& evaluation, const std::string& label);

}  // namespace raystage::evaluation
