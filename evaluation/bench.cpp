// SPDX-License-Identifier: Apache-2.0
// Measures error, time and memory of every setting (evaluate_views()) with every camera step and
// number of threads, one row at a time. Marks the Pareto fronts of PSNR and SSIM against time. Adds
// the prediction of the sampling theorem (thesis eq. 2.1). Cost: one evaluation per row.
#include "evaluation/bench.h"

#include <malloc.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <exception>
#include <fstream>
#include <limits>
#include <new>
#include <nlohmann/json.hpp>
#include <set>
#include <tuple>

#include "base/cancellation.h"
#include "base/error.h"
#include "base/resources.h"
#include "evaluation/pareto_front.h"
#include "render/methods.h"
#include "rig/plenoptic_sampling.h"

namespace raystage::evaluation {
namespace {

/// Returns whether the text is one line of UTF-8, as tables and JSON require.
bool is_printable(const std::string& text) {
  if (std::ranges::any_of(text, [](unsigned char c) { return c < 0x20 || c == 0x7f; }))
    return false;
  try {
    std::ignore = nlohmann::json(text).dump();
    return true;
  } catch (const nlohmann::json::type_error&) {
    return false;
  }
}

void check(const BenchPlan& plan) {
  if (plan.settings.empty() || plan.camera_steps.empty() || plan.threads.empty()) {
    throw Error::bad_input("no setting, camera step or number of threads is given", "bench",
                           "Set at least one setting, camera step and number of threads");
  }
  std::set<std::string> labels;
  for (const BenchSetting& setting : plan.settings) {
    if (!is_printable(setting.label)) {
      throw Error::bad_input("a setting's label is not one line of UTF-8 text", "bench",
                             "Write labels without control characters");
    }
    if (!labels.insert(setting.label).second) {
      throw Error::bad_input("two settings have the label '" + setting.label + "'", "bench",
                             "Give every setting a different label");
    }
    render::MethodOptions(render::method_named(setting.method).options(), setting.options,
                          "setting " + setting.label);
  }
}

std::string processor_name() {
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);) {
    if (!line.starts_with("model name")) continue;
    const std::size_t colon = line.find(": ");
    if (colon != std::string::npos) return line.substr(colon + 2);
  }
  return "unknown";
}

/// Applies eq. 2.1 to the cameras of a row, with their mean focal length.
std::optional<SpacingPrediction> prediction_of(const store::Take& take,
                                               const std::vector<std::string>& excluded_camera_ids,
                                               const BenchRow& row) {
  if (!take.document().depth_range) return std::nullopt;
  const std::vector<int> excluded_cameras =
      excluded_camera_indices(take, excluded_camera_ids, row.camera_step);
  std::vector<int> cameras;
  double focal_length = 0;
  for (int camera = 0; camera < take.camera_count(); ++camera) {
    if (std::ranges::find(excluded_cameras, camera) != excluded_cameras.end()) continue;
    cameras.push_back(camera);
    focal_length += take.rig().cameras[camera].model.intrinsics().fx;
  }
  focal_length /= static_cast<double>(cameras.size());
  SpacingPrediction predicted;
  predicted.spacing =
      rig::max_neighbour_baseline(take.rig(), rig::make_topology(take.rig(), cameras));
  predicted.disparity_px =
      rig::disparity_range(focal_length, predicted.spacing, *take.document().depth_range);
  predicted.planes = rig::alias_free_plane_count(predicted.disparity_px);
  predicted.alias_free =
      rig::alias_free_depth_range(focal_length, predicted.spacing, row.evaluation.focal_depth);
  return predicted;
}

bool has_same_cameras_and_threads(const BenchRow& a, const BenchRow& b) {
  return a.camera_step == b.camera_step && a.threads == b.threads;
}

void mark_fronts(std::vector<BenchRow>& rows) {
  const auto mark = [&](auto quality_of, bool BenchRow::*flag) {
    for (BenchRow& row : rows) {
      // Rows of other cameras or threads, and failed ones, cannot dominate these.
      std::vector<ParetoPoint> points;
      for (const BenchRow& other : rows) {
        const bool comparable =
            has_same_cameras_and_threads(other, row) && has_comparable_coverage(other, rows);
        points.push_back(
            {comparable ? other.seconds_per_frame() : std::numeric_limits<double>::quiet_NaN(),
             quality_of(other)});
      }
      row.*flag = pareto_front(points)[&row - rows.data()] != 0;
    }
  };
  mark([](const BenchRow& row) { return row.evaluation.mean.quality.psnr_db; },
       &BenchRow::on_psnr_front);
  mark([](const BenchRow& row) { return row.evaluation.mean.quality.ssim; },
       &BenchRow::on_ssim_front);
}

}  // namespace

std::vector<BenchSetting> default_bench_settings() {
  std::vector<BenchSetting> settings;
  for (const render::Method* method : render::methods()) {
    const std::string name(method->name());
    settings.push_back({name, name, {}, {}});
    for (const render::MethodPreset& preset : method->presets()) {
      settings.push_back({name + " " + std::string(preset.name),
                          name,
                          render::options_from_text(preset.options),
                          {}});
    }
  }
  return settings;
}

BenchSetting parse_bench_setting(std::string_view text) {
  const std::size_t first = text.find(':');
  if (first == std::string_view::npos) return {std::string(text), std::string(text), {}, {}};
  const std::string_view rest = text.substr(first + 1);
  const std::size_t second = std::min(rest.find(':'), rest.size());
  const std::string_view options = rest.substr(std::min(second + 1, rest.size()));
  if (first == 0 || second == 0) {
    throw Error::bad_input(
        "found '" + std::string(text) + "', allowed: LABEL:METHOD:NAME=VALUE,...", "setting",
        "Write it as in fine:plane_sweep:planes=96")
        .concerning({"setting"});
  }
  return {std::string(text.substr(0, first)),
          std::string(rest.substr(0, second)),
          render::options_from_text(options),
          {}};
}

bool has_comparable_coverage(const BenchRow& row, std::span<const BenchRow> rows) {
  if (!row.failure.empty()) return false;
  double most_covered = 0;
  for (const BenchRow& other : rows) {
    if (!other.failure.empty() || !has_same_cameras_and_threads(row, other)) continue;
    most_covered = std::max(most_covered, other.evaluation.mean.quality.covered);
  }
  constexpr double kMaxLessCoverage = 0.15;
  return row.evaluation.mean.quality.covered >= most_covered - kMaxLessCoverage;
}

BenchResult measure_bench(const store::Take& take, const schemas::ViewsDocument& views,
                          const std::filesystem::path& views_folder, const BenchPlan& plan,
                          const std::function<void(const BenchResult&)>& on_row,
                          const std::function<void(double)>& progress, std::stop_token stop) {
  check(plan);
  BenchResult trade;
  trade.take = take.document().name;
  trade.cpu = processor_name();
  trade.repeat = plan.common.repeat;
  trade.exact_times = plan.common.exact_times;
  trade.crops = BenchCrops(plan.camera_steps.size() * plan.settings.size(),
                           static_cast<std::size_t>(std::max(plan.crops, 0)));
  std::exception_ptr first_failure;
  const std::size_t all = plan.threads.size() * plan.camera_steps.size() * plan.settings.size();
  bool measured = false;

  const auto measure = [&](BenchRow& row) {
    EvaluationOptions settings = plan.common;
    settings.method = row.setting.method;
    settings.options = row.setting.options;
    if (row.setting.focal_depth) settings.focal_depth = row.setting.focal_depth;
    settings.camera_step = row.camera_step;
    settings.use_take_folder = false;  // otherwise only the first row would compute stored data
    // Pictures do not depend on threads: store those of the first number of threads.
    if (row.threads == plan.threads.front()) {
      settings.on_view = [&](const EvaluatedView& picture) {
        trade.pictures.add(trade.rows.size(), picture, plan.pictures);
        trade.crops.add(trade.rows.size(), picture);
      };
    }
    malloc_trim(0);  // do not count the memory of the row before
    const bool counted = reset_peak_memory();
    const auto share = [&](double done) {
      progress((static_cast<double>(trade.rows.size()) + done) / static_cast<double>(all));
    };
    row.evaluation = evaluate_views(take, views, views_folder, settings, share, stop);
    row.peak_memory = counted ? peak_memory() : 0;
    row.predicted = prediction_of(take, settings.excluded_camera_ids, row);
  };

  for (const int threads : plan.threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism,
                                    static_cast<std::size_t>(threads));
    tbb::task_arena arena(threads);
    for (const int camera_step : plan.camera_steps) {
      for (const BenchSetting& setting : plan.settings) {
        BenchRow row;
        row.setting = setting;
        row.camera_step = camera_step;
        row.threads = threads;
        const auto failed = [&](const char* why) {
          row.evaluation = {};
          row.failure = why;
          trade.pictures.remove(trade.rows.size());
          trade.crops.remove(trade.rows.size());
          if (!first_failure) first_failure = std::current_exception();
        };
        try {
          arena.execute([&] { measure(row); });
          measured = true;
          if (trade.views.empty()) {
            for (const auto& view : row.evaluation.views) trade.views.push_back(view.id);
          }
        } catch (const Cancelled&) {
          return trade;
        } catch (const Error& error) {
          if (stop.stop_requested()) return trade;
          failed(error.what());
        } catch (const std::bad_alloc&) {
          failed("out of memory");  // the next row may need less
        }
        trade.rows.push_back(std::move(row));
        mark_fronts(trade.rows);
        trade.complete = trade.rows.size() == all;
        progress(static_cast<double>(trade.rows.size()) / static_cast<double>(all));
        if (measured) on_row(trade);
      }
    }
  }
  if (!measured) std::rethrow_exception(first_failure);
  return trade;
}

}  // namespace raystage::evaluation
