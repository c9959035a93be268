// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <string_view>
#include <vector>

#include "evaluation/bench_crops.h"
#include "evaluation/bench_images.h"
#include "evaluation/evaluation.h"
#include "schemas/bench_document.h"
#include "schemas/geometry.h"

namespace raystage::evaluation {

using BenchSetting = schemas::BenchDocument::Setting;

/// Returns every method with its default options and with each of its presets.
std::vector<BenchSetting> default_bench_settings();
/// Parses "METHOD", "LABEL:METHOD" or "LABEL:METHOD:NAME=VALUE,...". Throws Error (bad input).
BenchSetting parse_bench_setting(std::string_view text);

/// The measurements: every setting with every camera step and every number of threads.
struct BenchPlan {
  std::vector<BenchSetting> settings;
  std::vector<int> camera_steps{1};  ///< see EvaluationOptions::camera_step
  std::vector<int> threads{1};
  int pictures = 1;  ///< views whose pictures are stored, spread evenly
  int crops = 12;    ///< places in the views in which the rows are compared
  /// Shared by all: focal_depth (if a setting has none), excluded_camera_ids, exact_times,
  /// view_step, repeat, blend_space, memory_bytes, count_needed_pixels.
  EvaluationOptions common;
};

/// The prediction of the sampling theorem for the cameras of a row (thesis 2.2, eq. 2.1).
struct SpacingPrediction {
  double spacing = 0;              ///< of neighbouring cameras, metres
  double disparity_px = 0;         ///< range of neighbours' disparities over the scene's depths
  double planes = 1;               ///< focal planes required to avoid ghosting
  schemas::DepthRange alias_free;  ///< depths without ghosting for the row's focal plane, metres
};

/// The measurement of a setting.
struct BenchRow {
  BenchSetting setting;
  int camera_step = 1, threads = 1;
  std::string failure;          ///< reason, if nothing was measured; else empty
  Evaluation evaluation;        ///< means and all views
  std::size_t peak_memory = 0;  ///< largest resident memory during the row, bytes; 0: unknown
  std::optional<SpacingPrediction> predicted;         ///< none without a depth range
  bool on_psnr_front = false, on_ssim_front = false;  ///< among rows of equal cameras and threads

  /// Returns the wall-clock time of a view whose instant is prepared: decoding and rendering.
  double seconds_per_frame() const {
    return (evaluation.mean.decode_ms + evaluation.mean.render_ms) / 1e3;
  }
};

struct BenchResult {
  std::string take;
  std::string cpu;                 ///< name of the processor
  std::vector<std::string> views;  ///< ids
  bool complete = false;           ///< all rows of the plan are measured
  int repeat = 0;
  bool exact_times = false;  ///< as EvaluationOptions
  std::vector<BenchRow> rows;
  BenchImages pictures;
  BenchCrops crops;
};

/// Returns whether the row is measured, and its coverage at most 0.15 below the largest of the rows
/// with its cameras and threads. Only the errors of such rows are compared: omitting difficult
/// pixels is no improvement.
bool has_comparable_coverage(const BenchRow& row, std::span<const BenchRow> rows);

/// Measures the plan row by row and calls `on_row` with the result so far. If stopped, returns the
/// finished rows. A setting that cannot be rendered becomes a row with a failure. Throws Error (bad
/// input) if there is no setting, two have equal labels, a method or option is unknown, or no row
/// could be measured (as evaluate_views()).
BenchResult measure_bench(const store::Take& take, const schemas::ViewsDocument& views,
                          const std::filesystem::path& views_folder, const BenchPlan& plan,
                          const std::function<void(const BenchResult&)>& on_row,
                          const std::function<void(double)>& progress, std::stop_token stop);

// Reports of a result, documented in docs/formats/trade.md.
std::string bench_as_csv(const BenchResult& trade);
std::string bench_as_json(const BenchResult& trade);  ///< schema "raystage/trade/1"
/// Returns a Markdown table with aligned columns, and below it the methods' notes on the rows.
std::string bench_as_table(const BenchResult& trade);

}  // namespace raystage::evaluation
