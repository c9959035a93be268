// SPDX-License-Identifier: Apache-2.0
#include "calibrate/geometry/planarity.h"

#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <vector>

#include "rig/camera_model.h"

namespace raystage {

double planar_inlier_ratio(const ArrayModel& model) {
  std::vector<int> found;
  for (std::size_t i = 0; i < model.cameras.size(); ++i) {
    if (model.cameras[i].pose) found.push_back(static_cast<int>(i));
  }
  if (found.size() != 2) return 0;
  const std::vector<CameraModel> lenses = make_camera_models(model);
  std::vector<cv::Point2d> from, to;
  std::optional<cv::Point2d> first;
  int point = -1;
  for (const ArrayModel::Observation& o : model.observations) {
    if (o.point != point) first.reset();
    point = o.point;
    if (!model.counts(o)) continue;
    const auto ideal = lenses[static_cast<std::size_t>(o.camera)].ideal_from_pixel(o.pixel);
    if (!ideal) continue;
    const cv::Point2d place(ideal->x(), ideal->y());
    if (!first) {
      first = place;
    } else {
      from.push_back(*first);
      to.push_back(place);
    }
  }
  constexpr std::size_t kLeast = 5;  // four points always fit
  if (from.size() < kLeast) return 1;
  constexpr double kNear = 1.5;  // pixels
  cv::setRNGSeed(1);
  cv::Mat inliers;
  const double focal = model.cameras[static_cast<std::size_t>(found[1])].intrinsics.fx;
  if (cv::findHomography(from, to, cv::RANSAC, kNear / focal, inliers).empty()) return 0;
  return static_cast<double>(cv::countNonZero(inliers)) / static_cast<double>(from.size());
}

}  // namespace raystage
