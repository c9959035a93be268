// SPDX-License-Identifier: Apache-2.0
// Calibrates an array from detections (thesis 4.3): merges positions of a resting light and solves
// poses, points and lenses (solve.h, or board_array.h for boards). Then it sets the origin,
// rotation and scale of the world. The scale comes from held cameras, a board, an initial rig, or a
// known distance or spacing. Estimates the uncertainty and judges the result
// (calibration_verdict.h). Merging compares each point only with those in the same or an adjacent
// cell of a picture.
#include "calibrate/geometry/calibration.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>

#include "base/error.h"
#include "calibrate/geometry/alignment.h"

namespace raystage::calibrate {
namespace {

/// Returns the lenses and poses of the initial rig for the cameras of the detections.
std::vector<std::optional<rig::Pose>> begin_with(const Detections& detections,
                                                 const CalibrationOptions& options,
                                                 SolveOptions& solve) {
  const schemas::RigDocument& start = *options.start;
  std::vector<std::optional<rig::Pose>> poses;
  for (const auto& camera : detections.cameras) {
    const schemas::RigDocument::Camera* known = start.find(camera.id);
    if (known == nullptr) {
      throw Error::bad_input("the initial rig has no camera \"" + camera.id + "\"", "",
                             "Start from a rig of the same cameras");
    }
    if (known->geometry.width != camera.width || known->geometry.height != camera.height) {
      throw Error::bad_input(
          "the initial rig has another frame size for camera \"" + camera.id + "\"", "",
          "Start from a rig with the same frame size");
    }
    solve.lenses.push_back(known->geometry.intrinsics);
    const schemas::Intrinsics& lens = known->geometry.intrinsics;
    solve.lens_models.push_back({lens.projection, lens.half_angle});
    poses.emplace_back(rig::pose_from_matrix(known->geometry.world_from_camera));
    const bool held =
        options.fixes_all_poses ||
        std::ranges::find(options.fixed_cameras, camera.id) != options.fixed_cameras.end();
    solve.fixed_cameras.push_back(held);
  }
  if (schemas::is_calibrated(start)) {
    solve.poses = poses;
  } else {
    solve.lenses.clear();  // initial values only
  }
  return poses;
}

void check_held(const Detections& detections, const CalibrationOptions& options) {
  for (const std::string& id : options.fixed_cameras) {
    if (std::ranges::find(detections.cameras, id, &schemas::DetectionsDocument::Camera::id) ==
        detections.cameras.end()) {
      throw Error::bad_input("the camera \"" + id + "\" to hold is unknown", "held cameras",
                             "Name cameras of the rig, or \"lens\" or \"poses\"")
          .concerning({"fix"});
    }
  }
  const bool holds = !options.fixed_cameras.empty() || options.fixes_all_poses;
  if (holds && !(options.start && schemas::is_calibrated(*options.start))) {
    throw Error::bad_input("poses are to be held, but no calibrated rig defines them",
                           "held cameras", "Start from a calibrated rig")
        .concerning({"initial_rig"});
  }
}

/// Scales the model about the position `held`, because one held camera does not determine the
/// scale.
void scale_about(ArrayModel& model, const std::vector<std::optional<rig::Pose>>& known,
                 const Eigen::Vector3d& held) {
  double found = 0, expected = 0;
  for (std::size_t i = 0; i < known.size(); ++i) {
    if (!model.cameras[i].pose || !known[i]) continue;
    found += (model.cameras[i].pose->position - held).norm();
    expected += (known[i]->position - held).norm();
  }
  SimilarityTransform similarity;
  if (found > 0) similarity.scale = expected / found;
  similarity.translation = (1 - similarity.scale) * held;
  const auto keep = model.cameras;
  apply(similarity, model);
  for (std::size_t i = 0; i < keep.size(); ++i) {
    if (keep[i].pose && keep[i].pose->position == held) model.cameras[i].pose = keep[i].pose;
  }
}

/// Sets the origin, rotation and scale of the world. Held cameras have determined them already.
void settle_world(Calibration& calibration, const CalibrationOptions& options,
                  const std::vector<std::optional<rig::Pose>>& known, std::size_t held) {
  const auto know_scale_from = [&](const char* source) {
    calibration.scale_source = source;
    calibration.scale_is_known = true;
  };
  if (held >= 2) return know_scale_from("held cameras");
  const bool is_start = options.start && schemas::is_calibrated(*options.start);
  if (!options.board.empty()) {  // in metres already
    if (!is_start || !align_to_poses(calibration.model, known, false)) {
      align_to_array(calibration.model);
    }
    return know_scale_from("board");
  }
  if (held == 1) {
    const auto at = std::ranges::find(calibration.model.cameras, options.fixed_cameras.front(),
                                      &ArrayModel::Camera::id) -
                    calibration.model.cameras.begin();
    scale_about(calibration.model, known, known[at]->position);
    return know_scale_from("start");
  }
  if (is_start && align_to_poses(calibration.model, known)) {
    know_scale_from("start");
  } else {
    align_to_array(calibration.model);
  }
  if (scale_world(calibration.model, options.scale)) {
    know_scale_from(options.scale.distance ? "distance" : "spacing");
  }
}

}  // namespace

int merge_static_points(Detections& detections, double max_distance_px) {
  using Detection = Detections::Detection;
  std::vector<std::vector<Detection>> points, kept;
  for (const Detection& d : detections.detections) {
    if (points.empty() || points.back().front().point != d.point) points.emplace_back();
    points.back().push_back(d);
  }
  using Cell = std::tuple<int, long, long>;  // camera and cell of its picture
  std::map<Cell, std::vector<std::size_t>> by_cell;
  const auto cell_of = [&](const Detection& d, int dx, int dy) {
    return Cell{d.camera, std::lround(d.pixel.x() / max_distance_px) + dx,
                std::lround(d.pixel.y() / max_distance_px) + dy};
  };
  const auto is_same = [&](const std::vector<Detection>& a, const std::vector<Detection>& b) {
    int common = 0;
    for (const Detection& one : a) {
      for (const Detection& other : b) {
        if (one.camera != other.camera) continue;
        if (!((one.pixel - other.pixel).norm() <= max_distance_px)) return false;
        ++common;
      }
    }
    return common >= 2;
  };
  const auto is_repeated = [&](const std::vector<Detection>& point) {
    for (const Detection& d : point) {
      for (int dx = -1; dx <= 1; ++dx) {
        for (int dy = -1; dy <= 1; ++dy) {
          const auto there = by_cell.find(cell_of(d, dx, dy));
          if (there == by_cell.end()) continue;
          for (const std::size_t k : there->second) {
            if (is_same(point, kept[k])) return true;
          }
        }
      }
    }
    return false;
  };
  for (std::vector<Detection>& point : points) {
    if (is_repeated(point)) continue;
    for (const Detection& d : point) by_cell[cell_of(d, 0, 0)].push_back(kept.size());
    kept.push_back(std::move(point));
  }
  const auto merged = static_cast<int>(points.size() - kept.size());
  detections.detections.clear();
  for (const std::vector<Detection>& point : kept) {
    detections.detections.insert(detections.detections.end(), point.begin(), point.end());
  }
  return merged;
}

Calibration calibrate(const Detections& all, const CalibrationOptions& options) {
  check_held(all, options);
  Calibration calibration;
  Detections detections = all;
  const bool has_board = !options.board.empty();
  if (!has_board) calibration.merged_points = merge_static_points(detections);
  SolveOptions solve = options.solve;
  std::vector<std::optional<rig::Pose>> known;
  if (options.start) {
    solve.lens_models.clear();
    known = begin_with(detections, options, solve);
  }
  const auto has_other_lens = [&](const LensModel& lens) {
    return !(lens == solve.lens_models.front());
  };
  solve.lens_per_camera =
      solve.lens_per_camera || std::ranges::any_of(solve.lens_models, has_other_lens);
  const auto differs = [&](const schemas::Intrinsics& lens) {
    return !(lens == solve.lenses.front());
  };
  solve.lens_per_camera = solve.lens_per_camera || std::ranges::any_of(solve.lenses, differs);
  calibration.model = has_board ? solve_boards(detections, options.board, solve, calibration.solve)
                                : solve_array(detections, solve, calibration.solve);
  const auto held = static_cast<std::size_t>(std::ranges::count(solve.fixed_cameras, true));
  settle_world(calibration, options, known, held);
  calibration.grid = find_grid_positions(calibration.model);
  calibration.uncertainty =
      estimate_uncertainty(calibration.model, calibration.solve.last, options.limits.tolerances);
  calibration.verdict = judge_calibration(calibration.model, calibration.uncertainty,
                                          calibration.scale_is_known, options.limits);
  if (solve.lens_is_known) {
    calibration.verdict.warnings.emplace_back(
        "Lenses are held: their errors affect all results and are not part of any deviation. If "
        "the cameras are rotated against each other, do not hold the lenses.");
  }
  return calibration;
}

schemas::RigDocument make_rig_document(const Calibration& calibration,
                                       const std::optional<schemas::RigDocument>& start,
                                       const std::string& name) {
  schemas::RigDocument rig;
  rig.name = name;
  if (start) rig.topology = start->topology;
  for (std::size_t i = 0; i < calibration.model.cameras.size(); ++i) {
    const ArrayModel::Camera& camera = calibration.model.cameras[i];
    if (!camera.pose) continue;
    schemas::RigDocument::Camera out;
    const schemas::RigDocument::Camera* known = start ? start->find(camera.id) : nullptr;
    if (known != nullptr) out = *known;
    out.geometry.id = camera.id;
    out.geometry.width = camera.width;
    out.geometry.height = camera.height;
    out.geometry.intrinsics = camera.intrinsics;
    out.geometry.world_from_camera = rig::matrix_from_pose(*camera.pose);
    if (i < calibration.line_times.cameras.size()) {
      out.geometry.line_time_us = calibration.line_times.cameras[i].us;
    }
    if (calibration.grid && !out.geometry.row) {
      out.geometry.row = (*calibration.grid)[i]->row;
      out.geometry.column = (*calibration.grid)[i]->column;
    }
    rig.cameras.push_back(std::move(out));
  }
  if (rig.cameras.empty()) {
    throw Error::bad_input("no camera was calibrated", "", "Record the light again");
  }
  return rig;
}

}  // namespace raystage::calibrate
