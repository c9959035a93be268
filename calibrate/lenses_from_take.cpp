// SPDX-License-Identifier: Apache-2.0
// Calibrates the lenses of a take's cameras from views of a board (Zhang 2000, lens_calibration.h).
// Cameras of one model may share a prior. Cost: the board search in at most `max_views` frames per
// camera dominates.
#include "calibrate/lenses_from_take.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/error.h"
#include "base/options.h"
#include "calibrate/detect/board_detection.h"

namespace raystage::calibrate {
namespace {

std::vector<int> selected_cameras(const store::Take& take, const std::vector<std::string>& ids) {
  std::vector<int> cameras;
  for (const std::string& id : ids) {
    cameras.push_back(take.camera_index(id));
    if (cameras.back() < 0) {
      throw Error::bad_input("there is no camera \"" + id + "\"", take.folder().string(),
                             "Name cameras of the take (`raystage info`)");
    }
  }
  for (int i = 0; ids.empty() && i < take.camera_count(); ++i) cameras.push_back(i);
  return cameras;
}

/// Returns the ids of cameras that share a prior. Throws Error (bad input) for an unselected one.
std::vector<std::string> prior_group(const std::vector<CameraBoardViews>& selected,
                                     const std::vector<std::string>& given) {
  std::vector<std::string> ids;
  for (const CameraBoardViews& camera : selected) ids.push_back(camera.id);
  if (given == std::vector<std::string>{"all"}) return ids;
  for (const std::string& id : given) {
    if (std::ranges::find(ids, id) != ids.end()) continue;
    throw Error::bad_input("camera \"" + id + "\" is not among those to calibrate",
                           "the cameras that share a lens prior",
                           "Name cameras of the take that are calibrated, or: all")
        .concerning({"shared_lens_prior"});
  }
  return given;
}

/// Chooses the lens model of each camera.
class LensModelChoice {
 public:
  LensModelChoice(const store::Take& take, const LensesFromTakeOptions& options,
                  const std::stop_token& stop)
      : take_(take), options_(options), lens_(options.lens) {
    lens_.stop = stop;
  }

  LensCalibrationOptions options_of(int camera) const {
    const rig::Rig::Camera& recorded = take_.rig().cameras[static_cast<std::size_t>(camera)];
    const schemas::Intrinsics& lens = recorded.model.intrinsics();
    return with_model({options_.projection.value_or(lens.projection),
                       options_.half_angle ? options_.half_angle : lens.half_angle});
  }

  /// Returns the settings of cameras with a shared prior. Throws Error (bad input) if their models
  /// differ.
  LensCalibrationOptions options_of_group(
      const std::vector<int>& cameras, const std::vector<LensModelComparison>& comparisons) const {
    LensCalibrationOptions shared = options_of(cameras.front());
    if (!comparisons.empty()) {
      return with_model({best_common_projection(comparisons), shared.model.half_angle});
    }
    for (const int camera : cameras) {
      if (options_of(camera).model == shared.model) continue;
      throw Error::bad_input("the rig of the take states different lens models",
                             "the cameras that share a lens prior",
                             "Name cameras with one lens model, or choose the model")
          .concerning({"shared_lens_prior", "lens_model"});
    }
    return shared;
  }

 private:
  LensCalibrationOptions with_model(LensModel model) const {
    if (model.projection == schemas::Projection::kPinhole) model.half_angle.reset();
    LensCalibrationOptions result = lens_;
    result.model = model;
    return result;
  }

  const store::Take& take_;
  const LensesFromTakeOptions& options_;
  LensCalibrationOptions lens_;
};

}  // namespace

bool LensesFromTakeOptions::is_valid(std::string* reason) const {
  return is_within("views of a camera", max_views, 1, 1e6, reason) && lens.is_valid(reason);
}

std::vector<CameraLens> calibrate_lenses(const store::Take& take, const BoardDetector& detector,
                                         const LensesFromTakeOptions& options,
                                         const std::function<void(double)>& progress,
                                         const std::stop_token& stop) {
  require_valid(options, "calibration of lenses");
  const std::vector<int> cameras = selected_cameras(take, options.cameras);
  std::vector<CameraBoardViews> selected;
  for (const int index : cameras) {
    const rig::Rig::Camera& camera = take.rig().cameras[index];
    selected.push_back({camera.id, camera.model.width(), camera.model.height(), {}});
  }
  const std::vector<std::string> group = prior_group(selected, options.shared_prior);
  const LensModelChoice choice(take, options, stop);
  std::vector<CameraLens> lenses;
  std::vector<CameraBoardViews> grouped;
  std::vector<std::size_t> grouped_index;
  for (std::size_t k = 0; k < cameras.size(); ++k) {
    CameraBoardViews& camera = selected[k];
    camera.views = detect_board_views(
        take, cameras[k], detector, options.max_views,
        [&](double done) {
          progress((static_cast<double>(k) + done) / static_cast<double>(cameras.size()));
        },
        stop);
    CameraLens& lens = lenses.emplace_back(CameraLens{camera.id, camera.width, camera.height, {}});
    if (options.compares_models) {
      lens.comparison = compare_lens_models(camera, choice.options_of(cameras[k]));
    }
    if (std::ranges::find(group, camera.id) == group.end()) continue;
    grouped_index.push_back(k);
    grouped.push_back(camera);
  }
  for (std::size_t k = 0; k < selected.size(); ++k) {
    if (std::ranges::find(grouped_index, k) != grouped_index.end()) continue;
    CameraLens& lens = lenses[k];
    lens.calibration = lens.comparison ? lens.comparison->best_fit().calibration
                                       : calibrate_lens(selected[k], choice.options_of(cameras[k]));
  }
  if (!grouped.empty()) {
    std::vector<int> group_cameras;
    std::vector<LensModelComparison> comparisons;
    for (const std::size_t k : grouped_index) {
      group_cameras.push_back(cameras[k]);
      if (lenses[k].comparison) comparisons.push_back(*lenses[k].comparison);
    }
    auto found = calibrate_lenses_with_shared_prior(
        grouped, choice.options_of_group(group_cameras, comparisons));
    for (std::size_t i = 0; i < found.size(); ++i) {
      lenses[grouped_index[i]].calibration = std::move(found[i]);
    }
  }
  return lenses;
}

bool are_accepted(const std::vector<CameraLens>& lenses) {
  return std::ranges::all_of(
      lenses, [](const CameraLens& lens) { return lens.calibration.reasons.empty(); });
}

schemas::RigDocument make_lens_document(const std::vector<CameraLens>& lenses) {
  schemas::RigDocument document;
  document.name = schemas::kUncalibratedRigName;
  for (const CameraLens& lens : lenses) {
    schemas::RigDocument::Camera& camera = document.cameras.emplace_back();
    camera.geometry.id = lens.id;
    camera.geometry.width = lens.width;
    camera.geometry.height = lens.height;
    camera.geometry.intrinsics = lens.calibration.lens;
  }
  return document;
}

}  // namespace raystage::calibrate
