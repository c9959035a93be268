// SPDX-License-Identifier: Apache-2.0
#include "rig/calibration/board_lens.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

#include "rig/calibration/alignment.h"
#include "rig/calibration/opencv_pose.h"
#include "rig/calibration/uncertainty.h"
#include "rig/calibration/verdict.h"
#include "schemas/error.h"

namespace raystage {
namespace {

constexpr std::size_t kLeastViews = 3, kLeastCorners = 6;

/// One camera at rest, and every view a board of its own before it.
ArrayModel model_of_views(const std::vector<BoardView>& views, int width, int height,
                          const Intrinsics& lens) {
  ArrayModel model;
  model.cameras.push_back({"", width, height, lens, Pose{}});
  for (const BoardView& view : views) {
    ArrayModel::Body board;
    for (std::size_t i = 0; i < view.pixels.size(); ++i) {
      const auto point = static_cast<int>(model.points.size());
      board.points.push_back(point);
      board.in_body.emplace_back(view.on_board[i].x(), -view.on_board[i].y(), 0);
      model.points.emplace_back();
      model.frame_of_point.push_back(point);
      model.observations.push_back({0, point, view.pixels[i]});
    }
    model.bodies.push_back(std::move(board));
  }
  return model;
}

/// A first guess: the focal length by the boards' homographies, with the middle where it should be.
Intrinsics guessed_lens(const std::vector<BoardView>& views, int width, int height) {
  std::vector<std::vector<cv::Point3f>> boards;
  std::vector<std::vector<cv::Point2f>> pictures;
  for (const BoardView& view : views) {
    boards.emplace_back();
    pictures.emplace_back();
    for (std::size_t i = 0; i < view.pixels.size(); ++i) {
      boards.back().emplace_back(static_cast<float>(view.on_board[i].x()),
                                 static_cast<float>(view.on_board[i].y()), 0.0F);
      pictures.back().emplace_back(static_cast<float>(view.pixels[i].x()),
                                   static_cast<float>(view.pixels[i].y()));
    }
  }
  const cv::Mat matrix = cv::initCameraMatrix2D(boards, pictures, {width, height}, 1);
  double focal = matrix.at<double>(0, 0);
  const double likely = width;  // 53 degrees
  if (!(focal > likely / 20) || !(focal < likely * 20)) focal = likely;
  return {focal, focal, width / 2.0, height / 2.0, {}};
}

void place_boards(ArrayModel& model, const std::vector<BoardView>& views) {
  const CameraModel lens = lenses_of(model).front();
  for (std::size_t v = 0; v < views.size(); ++v) {
    model.bodies[v].pose = camera_from_board_of(views[v], lens);
  }
  place_points_of_bodies(model);
}

void mark_outliers(ArrayModel& model, double most_px) {
  const std::vector<CameraModel> lenses = lenses_of(model);
  for (ArrayModel::Observation& o : model.observations) {
    const auto residual = residual_of(model, lenses, o);
    o.is_outlier = !residual || !(residual->norm() <= most_px);
  }
}

void judge(LensCalibration& found) {
  constexpr double kFocal = 0.01, kRms = 1;
  const double deviation = 2 * std::max(found.deviations[0], found.deviations[1]) / found.lens.fx;
  if (!(deviation <= kFocal)) {
    found.reasons.push_back(fmt::format(
        "The focal length is known to {:.1f} % only (1 is tolerated).", 100 * deviation));
    found.next_steps.emplace_back(
        "Show the board large in the picture, in more frames, tilted by 20 to 45 degrees to every "
        "side: boards held flat tell nothing of the focal length.");
  }
  if (!(found.rms_px <= kRms)) {
    found.reasons.push_back(
        fmt::format("Corners are {:.2f} px (RMS) from where they should be (1 "
                    "is tolerated).",
                    found.rms_px));
    found.next_steps.emplace_back(
        "Check the board's squares and that it is flat, hold it still, or let --whole-lens-model "
        "find more of the lens.");
  }
  constexpr double kCovered = 0.5;
  if (found.covered < kCovered) {
    found.next_steps.emplace_back("Show the board in the corners of the picture, too.");
  }
}

}  // namespace

std::optional<Pose> camera_from_board_of(const BoardView& view, const CameraModel& lens) {
  std::vector<cv::Point3d> board;
  std::vector<cv::Point2d> seen;
  for (std::size_t i = 0; i < view.pixels.size(); ++i) {
    const auto ideal = lens.ideal_from_pixel(view.pixels[i]);
    if (!ideal) continue;
    board.emplace_back(view.on_board[i].x(), -view.on_board[i].y(), 0);
    seen.emplace_back(ideal->x(), ideal->y());
  }
  cv::Mat turn, translation;
  if (seen.size() < 4 || !cv::solvePnP(board, seen, cv::Mat::eye(3, 3, CV_64F), {}, turn,
                                       translation, false, cv::SOLVEPNP_IPPE)) {
    return std::nullopt;
  }
  return inverse(pose_from_opencv(turn, translation));
}

LensCalibration calibrate_lens(const std::vector<BoardView>& all, int width, int height,
                               const std::string& id, const LensSettings& settings) {
  std::vector<BoardView> views;
  std::ranges::copy_if(all, std::back_inserter(views),
                       [](const BoardView& view) { return view.pixels.size() >= kLeastCorners; });
  if (views.size() < kLeastViews) {
    throw Error::bad_input(
        fmt::format("camera \"{}\" saw the board in {} frames; a lens needs {} at least", id,
                    views.size(), kLeastViews),
        "", "Check --board and --square-mm, and show the board closer and in more ways");
  }
  ArrayModel model = model_of_views(views, width, height, guessed_lens(views, width, height));
  place_boards(model, views);
  BundleSettings bundle;
  bundle.held_cameras = {true};
  for (const LensFreedom lens :
       {LensFreedom::kFocalLength, LensFreedom::kRadial,
        settings.whole_lens_model ? LensFreedom::kWholeModel : LensFreedom::kRadial}) {
    bundle.lens = lens;
    adjust(model, bundle);
    place_boards(model, views);  // a view that went astray with the first guess comes back
    mark_outliers(model, std::max(settings.most_px, 3 * rms_of(model)));
    adjust(model, bundle);
  }
  mark_outliers(model, settings.most_px);
  adjust(model, bundle);

  LensCalibration found;
  found.lens = model.cameras.front().intrinsics;
  found.rms_px = rms_of(model);
  found.views = static_cast<int>(views.size());
  found.corners = static_cast<int>(model.observations.size());
  found.outliers = static_cast<int>(
      std::ranges::count_if(model.observations, [](const auto& o) { return o.is_outlier; }));
  found.covered = fits_of(model).front().covered;
  for (const ArrayModel::Body& board : model.bodies) {
    if (!board.pose) continue;
    const double cosine = std::abs(board.pose->world_from_camera_rotation(2, 2));
    found.largest_tilt_deg =
        std::max(found.largest_tilt_deg, std::acos(std::min(cosine, 1.0)) * 180 / std::numbers::pi);
  }
  const auto uncertainty = uncertainty_of(model, bundle, {});
  if (uncertainty && uncertainty->cameras.front()) {
    found.deviations = uncertainty->cameras.front()->lens;
  }
  judge(found);
  return found;
}

}  // namespace raystage
