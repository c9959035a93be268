// SPDX-License-Identifier: Apache-2.0
// Calibrates lenses by Zhang's method ("A flexible new technique for camera calibration", 2000)
// with bundle adjustment. Each view is a board with its own pose in front of a camera at the
// origin. The initial focal length comes from the homographies; parameters are released step by
// step and outliers removed. A fisheye's initial focal length comes from trials. A shared prior
// combines lenses of one model. Inputs: corners in pixels and metres; outputs: intrinsics in pixels
// with standard deviations. Cost: views times corners per iteration.
#include "calibrate/geometry/lens_calibration.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

#include "base/error.h"
#include "base/options.h"
#include "calibrate/geometry/board_view_model.h"
#include "calibrate/geometry/bundle_adjustment.h"
#include "calibrate/geometry/calibration_verdict.h"
#include "calibrate/geometry/uncertainty.h"

namespace raystage::calibrate {
namespace {

/// Returns the initial lens of a pinhole: the focal length from the boards' homographies, the
/// principal point in the image centre.
schemas::Intrinsics guessed_pinhole(const BoardViewList& views, int width, int height) {
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

/// Returns the initial lens of a fisheye: of several fields of view, refined a little, the one with
/// which the boards fit best.
schemas::Intrinsics guessed_fisheye(const BoardViewList& views, const CameraBoardViews& camera,
                                    const LensCalibrationOptions& options) {
  constexpr double kFar = 50;  // pixels: larger errors count alike
  BundleAdjustmentOptions bundle;
  bundle.fixed_cameras = {true};
  bundle.stop = options.stop;
  bundle.lens = LensRefinement::kFocalLength;
  bundle.loss_scale_px = 10;
  bundle.max_iterations = 15;
  schemas::Intrinsics best;
  double least = std::numeric_limits<double>::infinity();
  for (const double fov : trial_fovs({&options.model, 1})) {
    const schemas::Intrinsics lens = initial_lens(options.model, camera.width, camera.height, fov);
    ArrayModel model = make_board_view_model(views, {&camera, 1}, {&lens, 1});
    place_boards(model, views);
    run_bundle_adjustment(model, bundle);
    place_boards(model, views);
    const CameraModels lenses = camera_models(model);
    double sum = 0;
    for (const ArrayModel::Observation& o : model.observations) {
      const auto residual = reprojection_residual(model, lenses, o);
      sum += residual ? std::min(residual->norm(), kFar) : kFar;
    }
    if (sum >= least) continue;
    least = sum;
    best = model.cameras.front().intrinsics;
  }
  return best;
}

schemas::Intrinsics guessed_lens(const BoardViewList& views, const CameraBoardViews& camera,
                                 const LensCalibrationOptions& options) {
  if (options.model.projection == schemas::Projection::kPinhole) {
    return guessed_pinhole(views, camera.width, camera.height);
  }
  return guessed_fisheye(views, camera, options);
}

/// Refines lenses and boards step by step, and removes outliers.
void refine(ArrayModel& model, const BoardViewList& views, const LensCalibrationOptions& options,
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

/// Returns the tilt of a board, degrees: see LensCalibration::max_tilt_deg.
double tilt_deg(const ArrayModel::RigidBody& board, schemas::Projection projection) {
  const Eigen::Vector3d normal = board.pose->world_from_camera_rotation.col(2);
  Eigen::Vector3d towards = Eigen::Vector3d::UnitZ();
  if (projection != schemas::Projection::kPinhole) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (const Eigen::Vector3d& corner : board.points_in_body) sum += corner;
    towards = board.pose->world_from_camera(sum / static_cast<double>(board.points_in_body.size()));
  }
  const double cosine = std::abs(normal.dot(towards.normalized()));
  return std::acos(std::min(cosine, 1.0)) * 180 / std::numbers::pi;
}

/// Returns the results of each camera without the verdict.
std::vector<LensCalibration> described(const ArrayModel& model, const BoardViewList& views,
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
    found.max_tilt_deg =
        std::max(found.max_tilt_deg, tilt_deg(model.bodies[v], found.lens.projection));
  }
  return all;
}

/// Combines the estimates of lenses of one model: the mean over all cameras, with the deviation
/// among lenses of a model.
void share_deviations(std::vector<LensCalibration>& cameras) {
  const auto& parameters = lens_parameterization(cameras.front().lens.projection).parameters();
  for (std::size_t k = 0; k < kLensParameterCount; ++k) {
    if (parameters[k].deviation_in_type == 0) continue;  // principal points
    double information = 0;
    for (const LensCalibration& one : cameras) {
      if (one.deviations[k] > 0) information += std::pow(one.deviations[k], -2);
    }
    for (LensCalibration& one : cameras) {
      if (one.deviations[k] == 0) continue;
      const double differs = parameters[k].deviation_in_type * (k < 2 ? one.lens.fx : 1);
      one.deviations[k] =
          std::min(one.deviations[k], std::hypot(1 / std::sqrt(information), differs));
    }
  }
}

/// Rejects cameras whose own focal length contradicts that of the others.
void reject_other_focal_lengths(const std::vector<LensCalibration>& alone,
                                std::vector<LensCalibration>& found) {
  const double in_type =
      lens_parameterization(alone.front().lens.projection).parameters().front().deviation_in_type;
  for (std::size_t c = 0; c < alone.size(); ++c) {
    const LensCalibration& own = alone[c];
    double others = 0, information = 0;
    for (std::size_t i = 0; i < alone.size(); ++i) {
      if (i == c || !(alone[i].deviations[0] > 0)) continue;
      const double differs = in_type * alone[i].lens.fx;
      const double weight = 1 / (std::pow(alone[i].deviations[0], 2) + differs * differs);
      others += weight * alone[i].lens.fx;
      information += weight;
    }
    if (!(information > 0) || !(own.deviations[0] > 0)) continue;
    others /= information;
    constexpr double kSigmas = 3;
    const double deviation =
        std::hypot(own.deviations[0], in_type * own.lens.fx, 1 / std::sqrt(information));
    if (std::abs(own.lens.fx - others) <= kSigmas * deviation) continue;
    found[c].reasons.push_back(
        fmt::format("Its own focal length is {:.1f} +- {:.1f} px, that of the others {:.1f} px: "
                    "not of one kind.",
                    own.lens.fx, own.deviations[0], others));
    found[c].next_steps.emplace_back("Exclude it from the cameras with a shared lens prior.");
  }
}

}  // namespace

bool LensCalibrationOptions::is_valid(std::string* reason) const {
  return is_within("reprojection error (pixels)", max_error_px, 1e-6, 1e6, reason);
}

LensCalibration calibrate_lens(const CameraBoardViews& camera,
                               const LensCalibrationOptions& options) {
  require_valid(options, "calibration of a lens");
  const std::span<const CameraBoardViews> cameras(&camera, 1);
  const BoardViewList views(cameras);
  const schemas::Intrinsics guess = guessed_lens(views, camera, options);
  ArrayModel model = make_board_view_model(views, cameras, {&guess, 1});
  BundleAdjustmentOptions bundle;
  refine(model, views, options, bundle);
  LensCalibration found = described(model, views, bundle).front();
  judge(found);
  return found;
}

std::vector<LensCalibration> calibrate_lenses_with_shared_prior(
    std::span<const CameraBoardViews> cameras, const LensCalibrationOptions& options) {
  require_valid(options, "calibration of lenses");
  const BoardViewList views(cameras);
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
  ArrayModel model = make_board_view_model(views, cameras, lenses);
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
