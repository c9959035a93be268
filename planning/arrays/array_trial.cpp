// SPDX-License-Identifier: Apache-2.0
#include "planning/arrays/array_trial.h"

#include <stdlib.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <system_error>

#include "base/error.h"
#include "evaluation/evaluation.h"
#include "rig/plenoptic_sampling.h"
#include "schemas/views_document.h"
#include "simulate/simulate.h"
#include "store/take.h"
#include "store/timeline.h"

namespace raystage::planning {
namespace {

namespace fs = std::filesystem;

constexpr int kMostPerAxis = 8;
constexpr int kWidth = 320, kHeight = 240;
constexpr double kFovDeg = 62;

/// A folder that is removed at the end.
class ScratchFolder {
 public:
  ScratchFolder() {
    std::string name = (fs::temp_directory_path() / "raystage-plan-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) {
      throw Error::failed("the folder cannot be created", name, "Set TMPDIR to a writable folder");
    }
    path_ = name;
  }
  ~ScratchFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;

  const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

/// Returns the settings of a faultless array.
simulate::SimulationOptions options_for(int columns, int rows, double spacing) {
  simulate::SimulationOptions options;
  options.scene = "still";
  options.columns = columns;
  options.rows = rows;
  options.spacing = spacing;
  options.width = kWidth;
  options.height = kHeight;
  options.horizontal_fov_deg = kFovDeg;
  options.k1 = options.k2 = 0;
  options.lens_deviation = options.mounting_error = options.mounting_error_deg = 0;
  options.noise = 0;
  options.seconds = 0.7;
  options.startup_loss_s = 0.1;
  options.drop_probability = 0;
  options.truth_views = 6;
  return options;
}

/// Returns the ghosting, pixels, of a simulated take.
double ghosting_of(const store::Take& take, double spacing) {
  const double focal_length = kWidth / (2 * std::tan(kFovDeg * std::numbers::pi / 360));
  return rig::disparity_range(focal_length, spacing, take.document().depth_range.value()) / 2;
}

double measure(const store::Take& take, const std::string& method, const std::stop_token& stop) {
  const fs::path file = take.folder() / "views.json";
  evaluation::EvaluationOptions options;
  options.method = method;
  options.count_needed_pixels = false;
  const evaluation::Evaluation result = evaluation::evaluate_views(
      take, schemas::read_views(file), take.folder(), options, [](double) {}, stop);
  return result.mean.quality.psnr_db;
}

ArrayTrial try_array(const ArrayPlan& plan, std::size_t index, const std::string& created_by,
                     const std::stop_token& stop) {
  const ArrayAlternative& planned = plan.alternatives[index];
  ArrayTrial trial;
  trial.alternative = index;
  trial.columns = std::clamp(planned.columns, 1, kMostPerAxis);
  trial.rows = std::clamp(planned.rows, 1, kMostPerAxis);
  trial.is_extrapolated = trial.columns < planned.columns || trial.rows < planned.rows ||
                          planned.width_px > kWidth || planned.height_px > kHeight;
  // The depths that the cameras see depend on their spacing, so it is corrected once.
  trial.spacing = 0.06;
  constexpr int kRounds = 3;
  constexpr double kEqual = 0.02;  // relative
  for (int round = 0; round < kRounds; ++round) {
    const ScratchFolder scratch;
    const fs::path folder = scratch.path() / "take";
    simulate::simulate(options_for(trial.columns, trial.rows, trial.spacing), folder, created_by,
                       {}, stop);
    const store::Take take(folder);
    trial.ghosting_px = ghosting_of(take, trial.spacing);
    const bool is_equal =
        std::abs(trial.ghosting_px - planned.ghosting_px) <= kEqual * planned.ghosting_px;
    if (!is_equal && round + 1 < kRounds) {
      trial.spacing *= planned.ghosting_px / trial.ghosting_px;
      continue;
    }
    store::write_timeline(store::build_timeline(take, 0, 0), take);
    trial.predicted_db = predicted_focal_plane_db(trial.ghosting_px);
    trial.focal_plane_db = measure(take, "focal_plane", stop);
    trial.depth_db = measure(take, "depth", stop);
    break;
  }
  return trial;
}

/// Returns whether a simulated array shows what a planned one does: neighbours exist, and do not
/// stand so far apart that the small stage is between them.
bool can_be_simulated(const ArrayAlternative& planned) {
  constexpr double kMostGhosting = 16;  // pixels of 320
  return planned.cameras() > 1 && planned.ghosting_px > 0 && planned.ghosting_px <= kMostGhosting;
}

}  // namespace

double predicted_focal_plane_db(double ghosting_px) {
  // Mean squared errors add: that of resampling, and that of ghosting, which grows with its square
  // while it is smaller than the details of the picture, and in proportion beyond.
  constexpr double kResampling = 2.77e-3, kGhosting = 6.4e-4, kDetail = 4;  // measured; pixels
  const double ghosting =
      ghosting_px * ghosting_px / std::sqrt(1 + std::pow(ghosting_px / kDetail, 2));
  return -10 * std::log10(kResampling + kGhosting * ghosting);
}

std::vector<ArrayTrial> try_arrays(const ArrayPlan& plan,
                                   const std::vector<std::size_t>& alternatives,
                                   const std::string& created_by,
                                   const std::function<void(double)>& progress,
                                   const std::stop_token& stop) {
  std::vector<ArrayTrial> trials;
  std::size_t tried = 0;
  for (const std::size_t index : alternatives) {
    if (can_be_simulated(plan.alternatives[index])) {
      trials.push_back(try_array(plan, index, created_by, stop));
    }
    if (progress) {
      progress(static_cast<double>(++tried) / static_cast<double>(alternatives.size()));
    }
  }
  return trials;
}

}  // namespace raystage::planning
