// SPDX-License-Identifier: Apache-2.0
// Selects the cameras that each camera is matched with (the nearest that share its view) and the
// planes of its initial sweep. Planes are spaced by at most plane_px of disparity to the nearest
// neighbour at another station (rig/camera_stations.h): a pair behind a beam splitter has almost no
// disparity, but is matched with the other stations, too. Also computes the inverse depth per pixel
// of disparity, the median over the rig. Distances in metres, inverse depths in 1/m. Cost:
// O(cameras^2).
#include <algorithm>
#include <cmath>

#include "render/depth/camera_depths.h"
#include "rig/camera_stations.h"

namespace raystage::render {
namespace {

/// Returns the pixels that a point moves between two cameras per 1/m of inverse depth.
double disparity(const VirtualCamera& to, const VirtualCamera& from) {
  const PixelTransfer transfer = pixel_transfer(to, from);
  return std::hypot(transfer.parallax[0], transfer.parallax[1]);
}

/// Returns whether `other` sees one of 9 points of `camera`'s view at the middle of the scene.
bool share_a_view(const VirtualCamera& camera, const VirtualCamera& other,
                  const InverseDepthRange& range) {
  const PixelTransfer transfer = pixel_transfer(other, camera);
  const double q = (range.farthest + range.nearest) / 2;
  for (int i = 0; i < 9; ++i) {
    const int column = 1 + i % 3, row = 1 + i / 3;
    const double x = camera.width * column / 4.0, y = camera.height * row / 4.0;
    const auto part = [&](std::size_t r) {
      const double* m = transfer.direction.data() + 3 * r;
      return m[0] * x + m[1] * y + m[2] + q * transfer.parallax[r];
    };
    const double w = part(2), u = part(0), v = part(1);
    if (w > 0 && u >= 0 && v >= 0 && u <= w * other.width && v <= w * other.height) return true;
  }
  return false;
}

/// Returns the disparity to the nearest of depth_neighbours() at another station, or the nearest of
/// all if there is none; 0 without neighbours.
double disparity_to_neighbour(const CameraDepths& depths, const LightFieldFrame& instant,
                              int camera, const InverseDepthRange& range) {
  const std::vector<int> others =
      depth_neighbours(depths, instant, camera, range, static_cast<int>(depths.pinholes.size()));
  if (others.empty()) return 0;
  const auto elsewhere = std::ranges::find_if(
      others, [&](int other) { return depths.stations[other] != depths.stations[camera]; });
  const int neighbour = elsewhere == others.end() ? others[0] : *elsewhere;
  return disparity(depths.pinholes[neighbour], depths.pinholes[camera]);
}

}  // namespace

std::vector<int> depth_neighbours(const CameraDepths& depths, const LightFieldFrame& instant,
                                  int camera, const InverseDepthRange& range, int count) {
  const VirtualCamera& from = depths.pinholes[camera];
  std::vector<std::pair<double, int>> others;
  for (std::size_t i = 0; i < depths.pinholes.size(); ++i) {
    const int other = static_cast<int>(i);
    if (other == camera || !instant.is_present(other)) continue;
    const double distance = (depths.pinholes[i].pose.position - from.pose.position).norm();
    if (!(disparity(depths.pinholes[i], from) > 0)) continue;
    if (share_a_view(from, depths.pinholes[i], range)) others.emplace_back(distance, other);
  }
  std::ranges::sort(others);
  others.resize(std::min(others.size(), static_cast<std::size_t>(count)));
  std::vector<int> nearest;
  for (const auto& [distance, other] : others) nearest.push_back(other);
  return nearest;
}

InitialSweepPlanes initial_sweep_planes(const CameraDepths& depths, const LightFieldFrame& instant,
                                        int camera, const DepthEstimationOptions& options) {
  const VirtualCamera& from = depths.pinholes[camera];
  const InverseDepthRange seen = inverse_depth_range_in_view(from, *instant.rig, options.scene);
  if (seen.empty()) return {};
  const double moves = disparity_to_neighbour(depths, instant, camera, seen);
  const double steps = std::ceil((seen.nearest - seen.farthest) * moves / options.plane_px - 1e-9);
  const int count =
      1 + static_cast<int>(std::clamp(steps, 0.0, depth_estimation::kMaxPlanes - 1.0));
  if (count == 1) return {1, (seen.farthest + seen.nearest) / 2, 0, 1};
  return {count, seen.farthest, (seen.nearest - seen.farthest) / (count - 1), 1 + steps};
}

CameraDepths camera_depths_without_maps(const LightFieldFrame& instant,
                                        const DepthEstimationOptions& options) {
  CameraDepths depths;
  for (const rig::Rig::Camera& camera : instant.rig->cameras) {
    depths.pinholes.push_back(undistorted(camera.model, camera.pose));
  }
  depths.stations = rig::camera_stations(*instant.rig);
  depths.maps.resize(depths.pinholes.size());
  std::vector<double> moves;
  for (std::size_t i = 0; i < depths.pinholes.size(); ++i) {
    if (!instant.is_present(static_cast<int>(i))) continue;
    const InverseDepthRange range =
        inverse_depth_range_in_view(depths.pinholes[i], *instant.rig, options.scene);
    const double move = disparity_to_neighbour(depths, instant, static_cast<int>(i), range);
    if (move > 0) moves.push_back(move);
  }
  if (!moves.empty()) {
    const auto middle = moves.begin() + static_cast<std::ptrdiff_t>(moves.size() / 2);
    std::nth_element(moves.begin(), middle, moves.end());
    depths.inverse_depth_per_pixel = 1 / *middle;
  }
  for (std::size_t i = 0; i < options.regions.size(); ++i) {
    if (options.regions[i].is_empty()) continue;
    depths.pinholes[i] = cropped(depths.pinholes[i], options.regions[i]);
  }
  return depths;
}

}  // namespace raystage::render
