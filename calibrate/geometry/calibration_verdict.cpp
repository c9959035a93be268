// SPDX-License-Identifier: Apache-2.0
// Judges a calibration against limits: observations and reprojection error (pixels) per camera,
// share of outliers, groups of cameras without common points, weak directions of the uncertainty,
// unknown scale. With two cameras it also fits one homography to the common points by RANSAC:
// points in one plane leave two solutions (Ma et al. 2004, section 5.3). Produces sentences. Cost:
// one projection per observation, and for each point all pairs of cameras that observe it.
#include "calibrate/geometry/calibration_verdict.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

#include "calibrate/geometry/ray_view.h"

namespace raystage::calibrate {
namespace {

constexpr int kJoined = 6;  // common points that suffice for a relative pose
constexpr int kCells = 4;   // of the picture, per axis
constexpr const char* kMendFit =
    "Check for cameras that moved or refocused during the recording, and for wrong times "
    "(`raystage sync`); try a lens model per camera.";

std::vector<std::string> names_of(const std::vector<int>& cameras, const ArrayModel& model) {
  std::vector<std::string> names;
  for (const int i : cameras) names.push_back(model.cameras[i].id);
  return names;
}

void say_once(std::vector<std::string>& list, std::string sentence) {
  if (std::ranges::find(list, sentence) == list.end()) list.push_back(std::move(sentence));
}

void judge_cameras(CalibrationVerdict& verdict, const ArrayModel& model,
                   const AcceptanceLimits& limits) {
  const std::vector<CameraFit> fits = camera_fits(model);
  std::vector<std::string> blind, not_found, with_few, ill_fitting, narrow;
  for (std::size_t i = 0; i < fits.size(); ++i) {
    const std::string& id = model.cameras[i].id;
    if (fits[i].observations == 0) {
      blind.push_back(id);
    } else if (!model.cameras[i].pose) {
      not_found.push_back(fmt::format("{} ({} observations)", id, fits[i].observations));
    } else if (fits[i].inliers < limits.min_points) {
      with_few.push_back(fmt::format("{} ({})", id, fits[i].inliers));
    } else if (!(fits[i].rms_px <= limits.max_rms_px)) {
      ill_fitting.push_back(fmt::format("{} ({:.2f} px)", id, fits[i].rms_px));
    } else if (fits[i].image_coverage < 0.5) {
      narrow.push_back(fmt::format("{} ({:.0f} %)", id, 100 * fits[i].image_coverage));
    }
  }
  if (add_sentence(verdict.reasons, "Nothing was seen by ", blind, ".")) {
    verdict.next_steps.push_back(
        "Check the pictures of the cameras without detections: they may be covered, out of focus, "
        "turned away, or underexposed for the light.");
  }
  if (add_sentence(verdict.reasons, "No pose was found for ", not_found,
                   ": too few common points with the others.")) {
    verdict.next_steps.push_back(
        "Move the light through the space that these cameras share with their neighbours.");
  }
  if (add_sentence(verdict.reasons, fmt::format("Fewer than {} inliers in ", limits.min_points),
                   with_few, ".")) {
    verdict.next_steps.push_back("Record the light at more positions in front of these cameras.");
  }
  if (add_sentence(
          verdict.reasons,
          fmt::format("The reprojection error exceeds {:.2f} px RMS in ", limits.max_rms_px),
          ill_fitting, ".")) {
    verdict.next_steps.emplace_back(kMendFit);
  }
  if (add_sentence(verdict.warnings, "Points fill less than half of the picture in ", narrow,
                   ": the lens is extrapolated beyond them.")) {
    verdict.next_steps.push_back("Move the light into the corners of every camera's picture.");
  }
}

void judge_groups(CalibrationVerdict& verdict, const ArrayModel& model) {
  const Overlap overlap = compute_overlap(model);
  std::vector<std::vector<int>> groups;
  for (const auto& group : overlap.groups) {
    if (group.size() > 1) groups.push_back(group);
  }
  if (groups.size() > 1) {
    verdict.reasons.push_back(fmt::format(
        "The cameras fall into {} groups that share no points: {} / {}.", groups.size(),
        abbreviate_list(names_of(groups[0], model)), abbreviate_list(names_of(groups[1], model))));
    verdict.next_steps.push_back(
        "Move the light through the space that cameras of both groups see.");
  }
}

void judge_fit(CalibrationVerdict& verdict, const ArrayModel& model,
               const AcceptanceLimits& limits) {
  const double rms = rms_reprojection_error(model);
  if (!(rms <= limits.max_rms_px)) {
    verdict.reasons.push_back(
        fmt::format("The reprojection error is {:.2f} px RMS; at most {:.2f} px are accepted.", rms,
                    limits.max_rms_px));
    say_once(verdict.next_steps, kMendFit);
  }
  std::vector<int> seen_by(model.points.size(), 0);
  for (const ArrayModel::Observation& o : model.observations) {
    if (model.cameras[o.camera].pose) ++seen_by[o.point];
  }
  int could_count = 0, count = 0;
  for (const ArrayModel::Observation& o : model.observations) {
    if (seen_by[o.point] < 2) continue;
    could_count += model.cameras[o.camera].pose ? 1 : 0;
    count += model.counts(o) ? 1 : 0;
  }
  const double share = 1 - static_cast<double>(count) / std::max(could_count, 1);
  if (share > limits.max_outlier_ratio) {
    verdict.reasons.push_back(
        fmt::format("{:.0f} % of the detections are outliers; at most {:.0f} % are accepted.",
                    100 * share, 100 * limits.max_outlier_ratio));
    verdict.next_steps.push_back(
        "Darken the room, cover reflecting surfaces, and check the synchronisation (raystage "
        "sync).");
  }
}

/// Returns the share of used points whose observations in two cameras one homography explains, to
/// 1.5 pixels: they are in one plane or far away. Returns 0 unless exactly two cameras have a pose.
/// With more, a plane of points is no degenerate case (Ma et al. 2004, section 5.3).
double planar_inlier_ratio(const ArrayModel& model) {
  std::vector<int> found;
  for (std::size_t i = 0; i < model.cameras.size(); ++i) {
    if (model.cameras[i].pose) found.push_back(static_cast<int>(i));
  }
  if (found.size() != 2) return 0;
  const CameraModels lenses = camera_models(model);
  std::vector<Eigen::Vector3d> from_rays, to_rays;
  std::optional<Eigen::Vector3d> first;
  int point = -1;
  for (const ArrayModel::Observation& o : model.observations) {
    if (o.point != point) first.reset();
    point = o.point;
    if (!model.counts(o)) continue;
    const auto ray = lenses[o.camera].unproject(o.pixel);
    if (!ray) continue;
    if (!first) {
      first = ray;
    } else {
      from_rays.push_back(*first);
      to_rays.push_back(*ray);
    }
  }
  const RayView from_view(lenses[found[0]], from_rays), to_view(lenses[found[1]], to_rays);
  std::vector<cv::Point2d> from, to;
  for (std::size_t i = 0; i < from_rays.size(); ++i) {
    const auto from_point = from_view.point(from_rays[i]), to_point = to_view.point(to_rays[i]);
    if (!from_point || !to_point) continue;
    from.emplace_back(from_point->x(), from_point->y());
    to.emplace_back(to_point->x(), to_point->y());
  }
  constexpr std::size_t kMin = 5;  // four points always fit
  if (from.size() < kMin) return 1;
  constexpr double kNear = 1.5;  // pixels
  cv::setRNGSeed(1);
  cv::Mat inliers;
  const double focal = model.cameras[found[1]].intrinsics.fx;
  if (cv::findHomography(from, to, cv::RANSAC, kNear / focal, inliers).empty()) return 0;
  return static_cast<double>(cv::countNonZero(inliers)) / from.size();
}

/// Rejects a calibration of two cameras whose points are in one plane: it has two solutions.
void judge_flatness(CalibrationVerdict& verdict, const ArrayModel& model) {
  constexpr double kAllButAll = 0.9;
  if (!(planar_inlier_ratio(model) > kAllButAll)) return;
  verdict.reasons.emplace_back(
      "All points are near one plane, or far away: two cameras have two solutions for such "
      "points.");
  verdict.next_steps.emplace_back("Record the light at different depths, or with a third camera.");
}

/// Returns whether a lens has no known end: then its distortion counts up to the picture's corners.
bool has_endless_fisheye(const ArrayModel& model) {
  return std::ranges::any_of(model.cameras, [](const ArrayModel::Camera& camera) {
    return camera.intrinsics.projection != schemas::Projection::kPinhole &&
           !camera.intrinsics.half_angle;
  });
}

void judge_direction(CalibrationVerdict& verdict, const Uncertainty::Direction& direction,
                     const ArrayModel& model) {
  const std::string times =
      direction.deviation > 1000
          ? "not determined by the recording"
          : fmt::format("uncertain by {:.1f} times the tolerance", direction.deviation);
  say_once(verdict.reasons, fmt::format("{} {}.", describe_direction(direction, model), times));
  if (direction.distortion > 0.4 && has_endless_fisheye(model)) {
    say_once(verdict.next_steps,
             "If the picture of a fisheye ends before the corners, give its half angle: the "
             "distortion counts up to there.");
  }
  if (direction.focal_length + direction.principal_point + direction.distortion > 0.4) {
    say_once(
        verdict.next_steps,
        "Calibrate the lens with a board (`raystage calibrate lens`) and hold it: cameras with "
        "nearly parallel axes cannot distinguish a longer lens from a deeper scene. With other "
        "arrays, record the light also near, far and in the corners of the pictures.");
  } else {
    say_once(verdict.next_steps,
             "Record the light at more positions, nearer to the array (one to ten times its width) "
             "and at different depths.");
  }
}

/// Returns the number of cells of a picture that its lens reaches: a fisheye may leave the corners
/// dark.
int visible_cells(const rig::CameraModel& lens) {
  if (lens.fisheye() == nullptr) return kCells * kCells;
  int visible = 0;
  for (int cell = 0; cell < kCells * kCells; ++cell) {
    const int column = cell % kCells, row = cell / kCells;
    const Eigen::Vector2d middle((column + 0.5) * lens.width() / kCells,
                                 (row + 0.5) * lens.height() / kCells);
    visible += lens.unproject(middle) ? 1 : 0;
  }
  return std::max(visible, 1);
}

}  // namespace

std::vector<CameraFit> camera_fits(const ArrayModel& model) {
  const CameraModels lenses = camera_models(model);
  std::vector<CameraFit> fits(model.cameras.size());
  std::vector<std::array<bool, kCells * kCells>> image_coverage(fits.size());
  for (const ArrayModel::Observation& o : model.observations) {
    const auto i = static_cast<std::size_t>(o.camera);
    ++fits[i].observations;
    if (!model.counts(o)) continue;
    const auto residual = reprojection_residual(model, lenses, o);
    if (!residual) continue;
    ++fits[i].inliers;
    fits[i].rms_px += residual->squaredNorm();
    const auto cell = [](double at, int size) {
      return static_cast<std::size_t>(
          std::clamp(static_cast<int>(kCells * at / size), 0, kCells - 1));
    };
    image_coverage[i][cell(o.pixel.y(), model.cameras[i].height) * kCells +
                      cell(o.pixel.x(), model.cameras[i].width)] = true;
  }
  for (std::size_t i = 0; i < fits.size(); ++i) {
    fits[i].rms_px = fits[i].inliers > 0 ? std::sqrt(fits[i].rms_px / fits[i].inliers)
                                         : std::numeric_limits<double>::quiet_NaN();
    const auto covered = static_cast<double>(std::ranges::count(image_coverage[i], true));
    fits[i].image_coverage = std::min(covered / visible_cells(lenses[i]), 1.0);
  }
  return fits;
}

Overlap compute_overlap(const ArrayModel& model) {
  const std::size_t count = model.cameras.size();
  Overlap overlap;
  overlap.shared.assign(count, std::vector<int>(count, 0));
  for (std::size_t begin = 0, end = 0; begin < model.observations.size(); begin = end) {
    while (end < model.observations.size() &&
           model.observations[end].point == model.observations[begin].point) {
      ++end;
    }
    for (std::size_t a = begin; a < end; ++a) {
      for (std::size_t b = begin; b < end; ++b) {
        const int one = model.observations[a].camera, other = model.observations[b].camera;
        if (one != other) ++overlap.shared[one][other];
      }
    }
  }
  std::vector<bool> done(count, false);
  for (std::size_t start = 0; start < count; ++start) {
    if (done[start]) continue;
    std::vector<int> group{static_cast<int>(start)};
    done[start] = true;
    for (std::size_t k = 0; k < group.size(); ++k) {
      for (std::size_t other = 0; other < count; ++other) {
        if (done[other] || overlap.shared[group[k]][other] < kJoined) continue;
        done[other] = true;
        group.push_back(static_cast<int>(other));
      }
    }
    std::ranges::sort(group);
    overlap.groups.push_back(std::move(group));
  }
  std::ranges::stable_sort(overlap.groups, std::greater<>(),
                           [](const auto& g) { return g.size(); });
  return overlap;
}

std::vector<std::pair<int, int>> Overlap::pairs_without_points() const {
  std::vector<std::pair<int, int>> pairs;
  for (std::size_t a = 0; a < shared.size(); ++a) {
    for (std::size_t b = a + 1; b < shared.size(); ++b) {
      if (shared[a][b] == 0) pairs.emplace_back(static_cast<int>(a), static_cast<int>(b));
    }
  }
  return pairs;
}

std::string abbreviate_list(const std::vector<std::string>& names, std::size_t most) {
  if (names.size() <= most) return fmt::format("{}", fmt::join(names, ", "));
  return fmt::format("{} and {} more", fmt::join(names.begin(), names.begin() + most, ", "),
                     names.size() - most);
}

bool add_sentence(std::vector<std::string>& sentences, std::string_view before,
                  const std::vector<std::string>& names, std::string_view after) {
  if (names.empty()) return false;
  sentences.push_back(fmt::format("{}{}{}", before, abbreviate_list(names), after));
  return true;
}

std::string describe_direction(const Uncertainty::Direction& d, const ArrayModel& model) {
  struct Part {
    double share;
    const char* name;
  };
  std::array<Part, 5> parts{
      Part{d.focal_length, "the focal length (and with it the depth of everything)"},
      Part{d.principal_point, "the principal point"}, Part{d.distortion, "the distortion"},
      Part{d.positions, "the positions of cameras"}, Part{d.rotations, "the rotations of cameras"}};
  std::ranges::sort(parts, std::greater<>(), &Part::share);
  constexpr double kTakesPart = 0.2;
  std::string text = parts[0].name;
  for (std::size_t i = 1; i < parts.size() && parts[i].share > kTakesPart; ++i) {
    text += std::string(" together with ") + parts[i].name;
  }
  if (!d.cameras.empty() && d.positions + d.rotations > kTakesPart) {
    text += " (" + abbreviate_list(names_of(d.cameras, model)) + ")";
  }
  text[0] = 'T';
  return text + " is";
}

CalibrationVerdict judge_calibration(const ArrayModel& model,
                                     const std::optional<Uncertainty>& uncertainty,
                                     bool scale_is_known, const AcceptanceLimits& limits) {
  CalibrationVerdict verdict;
  judge_cameras(verdict, model, limits);
  judge_groups(verdict, model);
  judge_fit(verdict, model, limits);
  judge_flatness(verdict, model);
  constexpr double kAlike = 0.6, kSeen = 0.1;  // correlation; pixels
  if (uncertainty && uncertainty->correlation > kAlike && uncertainty->noise_px > kSeen) {
    verdict.warnings.push_back(fmt::format(
        "The residuals of {:.2f} px are not noise: those of successive points are correlated "
        "(correlation {:.2f}).",
        uncertainty->noise_px, uncertainty->correlation));
    say_once(verdict.next_steps, kMendFit);
  }
  if (uncertainty) {
    constexpr std::size_t kMaxDirections = 4;
    std::size_t said = 0;
    for (const Uncertainty::Direction& direction : uncertainty->weakest) {
      if (direction.deviation > 1 && said++ < kMaxDirections)
        judge_direction(verdict, direction, model);
    }
  }
  if (!scale_is_known) {
    verdict.reasons.emplace_back(
        "The scale is unknown: the path of a light does not determine it.");
    verdict.next_steps.emplace_back(
        "State the distance between neighbouring cameras, or any measured distance between two.");
  }
  return verdict;
}

}  // namespace raystage::calibrate
