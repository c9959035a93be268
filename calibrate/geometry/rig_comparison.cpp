// SPDX-License-Identifier: Apache-2.0
// Compares two rigs: aligns the second with the first by a similarity over the common cameras
// (alignment.h). Reports differences of position, rotation and focal length per camera. For pixel
// differences, 81 pixels of each camera are unprojected to four depths and projected by the second
// rig: 324 projections per camera.
#include "calibrate/geometry/rig_comparison.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <numbers>

#include "base/error.h"
#include "calibrate/geometry/alignment.h"
#include "calibrate/geometry/uncertainty.h"
#include "rig/camera_model.h"
#include "schemas/former_names.h"

namespace raystage::calibrate {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

struct Both {
  const schemas::RigDocument::Camera *first, *second;
  rig::Pose first_pose, second_pose;
};

double angle_between(const rig::Pose& a, const rig::Pose& b) {
  const Eigen::AngleAxisd turn(
      Eigen::Matrix3d(a.world_from_camera_rotation.transpose() * b.world_from_camera_rotation));
  return std::abs(turn.angle()) * 180 / std::numbers::pi;
}

/// Computes the pixel distances between the projections of common points.
void compare_pictures(const Both& both, double nearest, RigComparison::Camera& out) {
  const rig::CameraModel a(both.first->geometry), b(both.second->geometry);
  constexpr int kGrid = 9;
  double sum = 0;
  int count = 0;
  for (int i = 0; i < kGrid * kGrid; ++i) {
    const int column = i % kGrid, row = i / kGrid;
    const Vector2d pixel((column + 0.5) / kGrid * a.width(), (row + 0.5) / kGrid * a.height());
    const auto ray = a.unproject(pixel);
    if (!ray) continue;
    for (const double away : {nearest, 2 * nearest, 4 * nearest, 0.0}) {
      const Vector3d direction = both.first_pose.world_from_camera_rotation * *ray;
      const Vector3d in_second =
          away > 0 ? both.second_pose.camera_from_world(both.first_pose.position + away * direction)
                   : Vector3d(both.second_pose.world_from_camera_rotation.transpose() * direction);
      const auto seen = b.project(in_second);
      if (!seen) continue;
      const double off = (*seen - pixel).norm();
      sum += off * off;
      out.max_px = std::max(out.max_px, off);
      ++count;
    }
  }
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  out.rms_px = count > 0 ? std::sqrt(sum / count) : kNone;
  if (count == 0) out.max_px = kNone;
}

}  // namespace

RigComparison compare_rigs(const schemas::RigDocument& first, const schemas::RigDocument& second,
                           double nearest_m) {
  RigComparison comparison;
  std::vector<Both> common;
  ArrayModel places;
  for (const schemas::RigDocument::Camera& camera : first.cameras) {
    const schemas::RigDocument::Camera* other = second.find(camera.geometry.id);
    if (other == nullptr) {
      comparison.only_in_first.push_back(camera.geometry.id);
      continue;
    }
    common.push_back({&camera, other, rig::pose_from_matrix(camera.geometry.world_from_camera),
                      rig::pose_from_matrix(other->geometry.world_from_camera)});
    places.cameras.push_back({camera.geometry.id, 1, 1, {}, common.back().first_pose});
  }
  for (const schemas::RigDocument::Camera& camera : second.cameras) {
    if (first.find(camera.geometry.id) == nullptr) {
      comparison.only_in_second.push_back(camera.geometry.id);
    }
  }
  if (common.size() < 2) {
    throw Error::bad_input("the rigs have fewer than two cameras in common", "",
                           "Compare rigs whose cameras have the same ids");
  }
  std::vector<rig::Pose> from, to;
  for (const Both& both : common) {
    from.push_back(both.second_pose);
    to.push_back(both.first_pose);
  }
  const SimilarityTransform over = estimate_similarity(from, to);
  comparison.scale = over.scale;
  const double spacing = median_neighbour_distance(places);
  const double nearest = nearest_m > 0 ? nearest_m : spacing > 0 ? 10 * spacing : 1;
  for (Both& both : common) {
    both.second_pose = over(both.second_pose);
    RigComparison::Camera camera;
    camera.id = both.first->geometry.id;
    camera.position_m = (both.first_pose.position - both.second_pose.position).norm();
    camera.rotation_deg = angle_between(both.first_pose, both.second_pose);
    camera.focal_ratio = both.second->geometry.intrinsics.fx / both.first->geometry.intrinsics.fx;
    compare_pictures(both, nearest, camera);
    comparison.cameras.push_back(std::move(camera));
  }
  return comparison;
}

std::string format_rig_comparison(const RigComparison& comparison) {
  std::string text = fmt::format("{:<12} {:>10} {:>10} {:>10} {:>10} {:>10}\n", "camera",
                                 "shift, mm", "turn, deg", "RMS, px", "max, px", "focal, %");
  RigComparison::Camera most{"largest"};
  const auto row = [&](const RigComparison::Camera& c, double focal_percent) {
    text += fmt::format("{:<12} {:>10.3f} {:>10.4f} {:>10.3f} {:>10.3f} {:>+10.3f}\n", c.id,
                        1000 * c.position_m, c.rotation_deg, c.rms_px, c.max_px, focal_percent);
  };
  double focal = 0;
  for (const RigComparison::Camera& c : comparison.cameras) {
    const double percent = 100 * (c.focal_ratio - 1);
    row(c, percent);
    most.position_m = std::max(most.position_m, c.position_m);
    most.rotation_deg = std::max(most.rotation_deg, c.rotation_deg);
    most.rms_px = std::max(most.rms_px, c.rms_px);
    most.max_px = std::max(most.max_px, c.max_px);
    if (std::abs(percent) > std::abs(focal)) focal = percent;
  }
  row(most, focal);
  text +=
      fmt::format("scale: {:.6g} m of the first rig per metre of the second\n", comparison.scale);
  for (const std::string& id : comparison.only_in_first) text += "only in the first: " + id + "\n";
  for (const std::string& id : comparison.only_in_second) {
    text += "only in the second: " + id + "\n";
  }
  return text;
}

std::string rig_comparison_json(const RigComparison& comparison) {
  using Json = nlohmann::ordered_json;
  const auto number = [](double value) { return std::isfinite(value) ? Json(value) : Json(); };
  Json cameras = Json::array();
  for (const RigComparison::Camera& c : comparison.cameras) {
    cameras.push_back({{"id", c.id},
                       {"position_m", c.position_m},
                       {"rotation_deg", c.rotation_deg},
                       {"rms_px", number(c.rms_px)},
                       {"max_px", number(c.max_px)},
                       {"focal_ratio", c.focal_ratio}});
  }
  Json json{{"scale", comparison.scale},
            {"cameras", cameras},
            {"only_in_first", comparison.only_in_first},
            {"only_in_second", comparison.only_in_second}};
  constexpr schemas::FormerName kFormerNames[] = {{"position_m", "place_m"},
                                                  {"rotation_deg", "turn_deg"},
                                                  {"max_px", "most_px"},
                                                  {"focal_ratio", "focal_factor"}};
  schemas::add_former_names(json, kFormerNames);
  return json.dump(1) + "\n";
}

}  // namespace raystage::calibrate
