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
  LensCalibrationOptions lens = options.lens;
  lens.stop = stop;
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
    lenses.push_back({camera.id, camera.width, camera.height, {}});
    if (std::ranges::find(group, camera.id) == group.end()) continue;
    grouped_index.push_back(k);
    grouped.push_back(camera);
  }
  for (std::size_t k = 0; k < selected.size(); ++k) {
    if (std::ranges::find(grouped_index, k) != grouped_index.end()) continue;
    lenses[k].calibration = calibrate_lens(selected[k], lens);
  }
  if (!grouped.empty()) {
    auto found = calibrate_lenses_with_shared_prior(grouped, lens);
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

std::string format_lens(const CameraLens& lens) {
  const LensCalibration& found = lens.calibration;
  std::string text =
      fmt::format("Camera     {}: {:.3f} px RMS over {} corners in {} views, {} outliers\n",
                  lens.id, found.rms_px, found.corners, found.views, found.outliers);
  const LensParameters values = lens_parameters(found.lens);
  const auto& parameters = lens_parameterization(found.lens.projection).parameters();
  for (std::size_t k = 0; k < values.size(); ++k) {
    if (found.deviations[k] == 0 && values[k] == 0) continue;
    text += fmt::format("Lens       {} {:.5g} +- {:.2g}\n", parameters[k].name, values[k],
                        found.deviations[k]);
  }
  text += fmt::format("Coverage   {:.0f} % of the picture, tilts up to {:.0f} degrees\n",
                      100 * found.image_coverage, found.max_tilt_deg);
  for (const std::string& reason : found.reasons) text += "Rejected   " + reason + "\n";
  for (const std::string& step : found.next_steps) text += "Next       " + step + "\n";
  return text;
}

}  // namespace raystage::calibrate
