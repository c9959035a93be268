// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>
#include <vector>

#include "render/evaluation/bench_images.h"
#include "render/evaluation/evaluation.h"
#include "schemas/bench_document.h"
#include "schemas/geometry.h"

namespace raystage {

/// One way of rendering that is measured.
using BenchSetting = BenchDocument::Setting;

/// Every method as it is unless told, and with each of its presets.
std::vector<BenchSetting> default_bench_settings();
/// "METHOD", "LABEL:METHOD" or "LABEL:METHOD:NAME=VALUE,...". Throws Error (bad input).
BenchSetting parse_bench_setting(std::string_view text);

/// What is measured: every setting with every camera step and every number of threads.
struct BenchPlan {
  std::vector<BenchSetting> settings;
  std::vector<int> camera_steps{1};  ///< see EvaluationSettings::camera_step
  std::vector<int> threads{1};
  int pictures = 1;  ///< views of which pictures are kept, spread evenly
  /// What all have in common: focal_depth (where a setting has none), excluded_camera_ids,
  /// view_step, repeat, blend_space, memory_bytes, count_needed_pixels.
  EvaluationSettings common;
};

/// What the sampling theorem says of the cameras of a row (thesis 2.2, eq. 2.1).
struct SpacingPrediction {
  double spacing = 0;  ///< of neighbouring cameras, metres
  double disparity_px =
      0;              ///< between neighbours, from the nearest depth of the scene to the farthest
  double planes = 1;  ///< focal planes that free it of ghosts
  DepthRange alias_free;  ///< what the row's one focal plane frees, metres
};

/// A setting, measured.
struct BenchRow {
  BenchSetting setting;
  int camera_step = 1, threads = 1;
  std::string failure;          ///< why nothing was measured; empty where it was
  Evaluation evaluation;        ///< means, and every view
  std::size_t peak_memory = 0;  ///< bytes resident at most while it was measured; 0: unknown
  std::optional<SpacingPrediction> predicted;         ///< none without a depth range
  bool on_psnr_front = false, on_ssim_front = false;  ///< among rows of its cameras and threads

  /// Wall clock of a view whose instant is prepared: decoding and rendering.
  double seconds_per_frame() const {
    return (evaluation.mean.decode_ms + evaluation.mean.render_ms) / 1e3;
  }
};

struct BenchResult {
  std::string take;
  std::string cpu;                 ///< the processor's name
  std::vector<std::string> views;  ///< ids
  bool complete = false;           ///< every row of the plan is there
  int repeat = 0;
  std::vector<BenchRow> rows;
  BenchImages pictures;
};

/// Measures the plan row by row; after each `on_row` sees what there is so far. Asked to stop, it
/// returns the rows that are finished. A setting that cannot be rendered becomes a row that says
/// why. Throws Error (bad input): no setting, two of one label, an unknown method or option, and
/// what evaluate_views() throws where no row at all could be measured.
BenchResult measure_bench(const Take& take, const ViewsDocument& views,
                          const std::filesystem::path& views_folder, const BenchPlan& plan,
                          const std::function<void(const BenchResult&)>& on_row,
                          const std::function<void(double)>& progress, std::stop_token stop);

// What comes of it, documented in docs/formats/trade.md.
std::string bench_as_csv(const BenchResult& trade);
std::string bench_as_json(const BenchResult& trade);  ///< schema "raystage/trade/1"
/// A Markdown table, its columns aligned, and below it what methods have to say of their rows.
std::string bench_as_table(const BenchResult& trade);

}  // namespace raystage
