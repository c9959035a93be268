// SPDX-License-Identifier: Apache-2.0
// Calibrates lenses by Zhang's method ("A flexible new technique for camera calibration", 2000)
// with bundle adjustment. Each view is a board with its own pose in front of a camera at the
// origin. The initial focal length comes from the homographies; parameters are released step by
// step and outliers removed. A shared prior combines lenses of one model. Inputs: corners in pixels
// and metres; outputs: intrinsics in pixels with standard deviations. Cost: views times corners per
// iteration.
#include "calibrate/geometry/lens_calibration.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

#include "base/error.h"
#include "base/options.h"
#include "calibrate/geometry/alignment.h"
#include "calibrate/geometry/calibration_verdict.h"
#include "calibrate/geometry/opencv_pose.h"
#include "calibrate/geometry/uncertainty.h"

namespace raystage::calibrate {
namespace {

constexpr std::size_t kMinViews = 3, kMinLensCorners = 6;

/// Model with cameras at the origin and a board pose per view.
struct Views {
  std::vector<const BoardView*> views;
  std::vector<std::size_t> camera;  // camera of each view

  /// Returns the views with enough corners.
  explicit Views(std::span<const CameraBoardViews> cameras) {
    for (std::size_t c = 0; c < cameras.size(); ++c) {
      const std::size_t before = views.size();
      for (const BoardView& view : cameras[c].views) {
        if (view.pixels.size() < kMinLensCorners) continue;
        views.push_back(&view);
        camera.push_back(c);
      }
      if (views.size() - before >= kMinViews) continue;
      throw Error::bad_input(
          fmt::format("camera \"{}\" has {} usable frames of the board; a lens needs at least {}",
                      cameras[c].id, views.size() - before, kMinViews),
          "",
          "Check the size of the board and of its squares; record it closer and in more "
          "orientations")
          .concerning({"board", "square_mm"});
    }
  }
};

ArrayModel make_initial_model(const Views& views, std::span<const CameraBoardViews> cameras,
                              std::span<const schemas::Intrinsics> lenses) {
  ArrayModel model;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    model.cameras.push_back(
        {cameras[c].id, cameras[c].width, cameras[c].height, lenses[c], rig::Pose{}});
  }
  for (std::size_t v = 0; v < views.views.size(); ++v) {
    const BoardView& view = *views.views[v];
    ArrayModel::RigidBody board;
    for (std::size_t i = 0; i < view.pixels.size(); ++i) {
      const auto point = static_cast<int>(model.points.size());
      board.points.push_back(point);
      board.points_in_body.emplace_back(view.object_points[i].x(), -view.object_points[i].y(), 0);
      model.points.emplace_back();
      model.point_ids.push_back(point);
      model.observations.push_back({static_cast<int>(views.camera[v]), point, view.pixels[i]});
    }
    model.bodies.push_back(std::move(board));
  }
  return model;
}

/// Returns the initial lens: the focal length from the boards' homographies, the principal point in
/// the image centre.
schemas::Intrinsics guessed_lens(const Views& views, int width, int height) {
  std::vector<std::vector<cv::Point3f>> boards;
  std::vector<std::vector<cv::Point2f>> pictures;
  for (const BoardView* const view : views.views) {
    boards.emplace_back();
    pictures.emplace_back();
    for (std::size_t i = 0; i < view->pixels.size(); ++i) {
      boards.back().emplace_back(static_cast<float>(view->object_points[i].x()),
                                 static_cast<float>(view->object_points[i].y()), 0.0F);
      pictures.back().emplace_back(static_cast<float>(view->pixels[i].x()),
                                   static_cast<float>(view->pixels[i].y()));
    }
  }
  const cv::Mat matrix = cv::initCameraMatrix2D(boards, pictures, {width, height}, 1);
  double focal = matrix.at<double>(0, 0);
  const double likely = width;  // a field of view of 53 degrees
  if (!(focal > likely / 20) || !(focal < likely * 20)) focal = likely;
  return {focal, focal, width / 2.0, height / 2.0, {}};
}

void place_boards(ArrayModel& model, const Views& views) {
  const CameraModels lenses = camera_models(model);
  for (std::size_t v = 0; v < views.views.size(); ++v) {
    model.bodies[v].pose = estimate_board_pose(*views.views[v], lenses[views.camera[v]]);
  }
  update_body_points(model);
}

void mark_outliers(ArrayModel& model, double max_error_px) {
  const CameraModels lenses = camera_models(model);
  for (ArrayModel::Observation& o : model.observations) {
    const auto residual = reprojection_residual(model, lenses, o);
    o.is_outlier = !residual || !(residual->norm() <= max_error_px);
  }
}

void judge(LensCalibration& found) {
  constexpr double kFocal = 0.01, kRms = 1;
  const double deviation = 2 * std::max(found.deviations[0], found.deviations[1]) / found.lens.fx;
  if (!(deviation <= kFocal)) {
    found.reasons.push_back(fmt::format(
        "The focal length is uncertain by {:.1f} %; at most 1 % is accepted.", 100 * deviation));
    found.next_steps.emplace_back(
        "Record the board large in the picture, in more frames, tilted by 20 to 45 degrees to "
        "every "
        "side: boards parallel to the picture do not determine the focal length.");
  }
  if (!(found.rms_px <= kRms)) {
    found.reasons.push_back(
        fmt::format("The reprojection error of corners is {:.2f} px RMS; at most 1 px is accepted.",
                    found.rms_px));
    found.next_steps.emplace_back(
        "Check the board's squares and that it is flat, hold it still, or estimate the full lens "
        "model.");
  }
  constexpr double kMaxOutlierShare = 0.1;
  if (found.outliers > kMaxOutlierShare * found.corners) {
    found.reasons.push_back(fmt::format("{} of {} corners do not fit; at most a tenth is accepted.",
                                        found.outliers, found.corners));
    found.next_steps.emplace_back(
        "Check the size of the board's squares, and that it is flat and in focus.");
  }
  constexpr double kCovered = 0.5;
  if (found.image_coverage < kCovered) {
    found.next_steps.emplace_back("Record the board in the corners of the picture, too.");
  }
}

/// Refines lenses and boards step by step, and removes outliers.
void refine(ArrayModel& model, const Views& views, const LensCalibrationOptions& options,
            BundleAdjustmentOptions& bundle) {
  bundle.fixed_cameras.assign(model.cameras.size(), true);
  bundle.stop = options.stop;
  place_boards(model, views);
  for (const LensRefinement lens :
       {LensRefinement::kFocalLength, LensRefinement::kRadial,
        options.full_lens_model ? LensRefinement::kFullModel : LensRefinement::kRadial}) {
    bundle.lens = lens;
    run_bundle_adjustment(model, bundle);
    place_boards(model, views);  // recovers a view whose pose diverged with the initial lens
    mark_outliers(model, std::max(options.max_error_px, 3 * rms_reprojection_error(model)));
    run_bundle_adjustment(model, bundle);
  }
  mark_outliers(model, options.max_error_px);
  run_bundle_adjustment(model, bundle);
}

/// Returns the results of each camera without the verdict.
std::vector<LensCalibration> described(const ArrayModel& model, const Views& views,
                                       const BundleAdjustmentOptions& bundle) {
  std::vector<LensCalibration> all(model.cameras.size());
  const std::vector<CameraFit> fits = camera_fits(model);
  const auto uncertainty = estimate_uncertainty(model, bundle, {});
  for (std::size_t c = 0; c < all.size(); ++c) {
    all[c].lens = model.cameras[c].intrinsics;
    all[c].rms_px = fits[c].rms_px;
    all[c].image_coverage = fits[c].image_coverage;
    if (uncertainty && uncertainty->cameras[c]) all[c].deviations = uncertainty->cameras[c]->lens;
  }
  for (const ArrayModel::Observation& o : model.observations) {
    LensCalibration& found = all[o.camera];
    ++found.corners;
    found.outliers += o.is_outlier ? 1 : 0;
  }
  for (std::size_t v = 0; v < model.bodies.size(); ++v) {
    LensCalibration& found = all[views.camera[v]];
    ++found.views;
    if (!model.bodies[v].pose) continue;
    const double cosine = std::abs(model.bodies[v].pose->world_from_camera_rotation(2, 2));
    found.max_tilt_deg =
        std::max(found.max_tilt_deg, std::acos(std::min(cosine, 1.0)) * 180 / std::numbers::pi);
  }
  return all;
}

/// Combines the estimates of lenses of one model: the mean over all cameras, with the deviation
/// among lenses of a model.
void share_deviations(std::vector<LensCalibration>& cameras) {
  for (std::size_t k = 0; k < kLensParameterCount; ++k) {
    if (k == 2 || k == 3) continue;  // principal points
    double information = 0;
    for (const LensCalibration& one : cameras) {
      if (one.deviations[k] > 0) information += std::pow(one.deviations[k], -2);
    }
    for (LensCalibration& one : cameras) {
      if (one.deviations[k] == 0) continue;
      const double differs = kLensPriorDeviations[k] * (k < 2 ? one.lens.fx : 1);
      one.deviations[k] =
          std::min(one.deviations[k], std::hypot(1 / std::sqrt(information), differs));
    }
  }
}

/// Rejects cameras whose own focal length contradicts that of the others.
void reject_other_focal_lengths(const std::vector<LensCalibration>& alone,
                                std::vector<LensCalibration>& found) {
  for (std::size_t c = 0; c < alone.size(); ++c) {
    const LensCalibration& own = alone[c];
    double others = 0, information = 0;
    for (std::size_t i = 0; i < alone.size(); ++i) {
      if (i == c || !(alone[i].deviations[0] > 0)) continue;
      const double differs = kLensPriorDeviations[0] * alone[i].lens.fx;
      const double weight = 1 / (std::pow(alone[i].deviations[0], 2) + differs * differs);
      others += weight * alone[i].lens.fx;
      information += weight;
    }
    if (!(information > 0) || !(own.deviations[0] > 0)) continue;
    others /= information;
    constexpr double kSigmas = 3;
    const double deviation = std::hypot(own.deviations[0], kLensPriorDeviations[0] * own.lens.fx,
                                        1 / std::sqrt(information));
    if (std::abs(own.lens.fx - others) <= kSigmas * deviation) continue;
    found[c].reasons.push_back(
        fmt::format("Its own focal length is {:.1f} +- {:.1f} px, that of the others {:.1f} px: "
                    "not of one kind.",
                    own.lens.fx, own.deviations[0], others));
    found[c].next_steps.emplace_back("Exclude it from the cameras with a shared lens prior.");
  }
}

}  // namespace

std::optional<rig::Pose> estimate_board_pose(const BoardView& view, const rig::CameraModel& lens) {
  std::vector<cv::Point3d> board;
  std::vector<cv::Point2d> seen;
  for (std::size_t i = 0; i < view.pixels.size(); ++i) {
    const auto ideal = lens.ideal_from_pixel(view.pixels[i]);
    if (!ideal) continue;
    board.emplace_back(view.object_points[i].x(), -view.object_points[i].y(), 0);
    seen.emplace_back(ideal->x(), ideal->y());
  }
  cv::Mat turn, translation;
  if (seen.size() < 4 || !cv::solvePnP(board, seen, cv::Mat::eye(3, 3, CV_64F), {}, turn,
                                       translation, false, cv::SOLVEPNP_IPPE)) {
    return std::nullopt;
  }
  return inverse(pose_from_opencv(turn, translation));
}

bool LensCalibrationOptions::is_valid(std::string* reason) const {
  return is_within("reprojection error (pixels)", max_error_px, 1e-6, 1e6, reason);
}

LensCalibration calibrate_lens(const CameraBoardViews& camera,
                               const LensCalibrationOptions& options) {
  require_valid(options, "calibration of a lens");
  const std::span<const CameraBoardViews> cameras(&camera, 1);
  const Views views(cameras);
  const schemas::Intrinsics guess = guessed_lens(views, camera.width, camera.height);
  ArrayModel model = make_initial_model(views, cameras, {&guess, 1});
  BundleAdjustmentOptions bundle;
  refine(model, views, options, bundle);
  LensCalibration found = described(model, views, bundle).front();
  judge(found);
  return found;
}

std::vector<LensCalibration> calibrate_lenses_with_shared_prior(
    std::span<const CameraBoardViews> cameras, const LensCalibrationOptions& options) {
  require_valid(options, "calibration of lenses");
  const Views views(cameras);
  std::vector<LensCalibration> alone;
  std::vector<schemas::Intrinsics> lenses;
  double focal_length = 0, weights = 0, noise_px = 0;
  for (const CameraBoardViews& camera : cameras) {
    if (camera.width != cameras.front().width || camera.height != cameras.front().height) {
      throw Error::bad_input(
          "camera \"" + camera.id + "\" has another frame size than \"" + cameras.front().id + "\"",
          "cameras with a shared lens prior", "Name cameras of one model, with equal frame sizes")
          .concerning({"shared_lens_prior"});
    }
    const LensCalibration& own = alone.emplace_back(calibrate_lens(camera, options));
    lenses.push_back(own.lens);
    const double weight = own.deviations[0] > 0 ? std::pow(own.deviations[0], -2) : 0;
    focal_length += weight * own.lens.fx;
    weights += weight;
    noise_px += own.rms_px / std::numbers::sqrt2 / static_cast<double>(cameras.size());
  }
  for (schemas::Intrinsics& lens : lenses) {
    if (weights > 0) lens.fx = lens.fy = focal_length / weights;
  }
  ArrayModel model = make_initial_model(views, cameras, lenses);
  BundleAdjustmentOptions bundle;
  bundle.shared_lens = false;
  constexpr double kMinNoise = 0.02;
  bundle.lens_prior_noise_px = std::max(noise_px, kMinNoise);
  refine(model, views, options, bundle);
  std::vector<LensCalibration> found = described(model, views, bundle);
  share_deviations(found);
  for (LensCalibration& one : found) judge(one);
  reject_other_focal_lengths(alone, found);
  return found;
}

}  // namespace raystage::calibrate
