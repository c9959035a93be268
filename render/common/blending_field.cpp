// SPDX-License-Identifier: Apache-2.0
// Blending weights of cameras on a grid of tiles (after Buehler et al. 2001 and thesis eq. 2.3,
// without the resolution penalty). At each tile corner every included camera gets a penalty: the
// angle between its ray and the view's ray, divided by its visibility. The best few get weights
// that fall to 0 before a camera drops out; within tiles weights are linear. Also computes depth
// ranges and plane counts in view (eq. 2.1). Input: view, rig, range of inverse depths (1/m). Cost:
// corners x cameras.

#include "render/common/blending_field.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <set>
#include <utility>

#include "base/parallel.h"
#include "rig/camera_stations.h"

namespace raystage::render {
namespace {

using Eigen::Vector3d;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
/// The fraction of the frame's width inside the border from which a camera has full visibility.
constexpr double kBorderPart = 0.05;

/// A point on a ray. towards() returns the vector from the point to a position, times the point's
/// inverse depth: finite at infinity.
struct RayPoint {
  Vector3d eye, ray;
  double inverse_depth = 0;
  Vector3d towards(const Vector3d& place) const { return inverse_depth * (place - eye) - ray; }
};

double angle_between(const Vector3d& a, const Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

/// Returns the camera's visibility of the point, 0 to 1.
double point_visibility(const rig::Rig::Camera& camera, const RayPoint& point) {
  const Vector3d direction =
      camera.pose.world_from_camera_rotation.transpose() * -point.towards(camera.pose.position);
  const auto pixel = camera.model.project(direction);
  if (!pixel) return 0;
  const double to_border = std::min({pixel->x(), camera.model.width() - pixel->x(), pixel->y(),
                                     camera.model.height() - pixel->y()});
  return std::clamp(to_border / (kBorderPart * camera.model.width()), 0.0, 1.0) *
         camera.model.facet_share(direction);
}

/// Returns the mean visibility over the ray's range of depths, because the depth of the point is
/// not known yet.
double mean_visibility(const rig::Rig::Camera& camera, RayPoint point,
                       const InverseDepthRange& range) {
  constexpr int kPoints = 5;
  double sum = 0;
  for (int i = 0; i < kPoints; ++i) {
    point.inverse_depth =
        std::lerp(range.farthest, range.nearest, static_cast<double>(i) / (kPoints - 1));
    sum += point_visibility(camera, point);
  }
  return sum / kPoints;
}

std::vector<CameraWeight> choose(const RayPoint& point, const InverseDepthRange& range,
                                 const rig::Rig& rig, const std::vector<int>& members, int count) {
  std::vector<CameraWeight> all;  // `share` holds penalties until the last loops
  for (const int member : members) {
    const rig::Rig::Camera& camera = rig.cameras[member];
    const double visibility = mean_visibility(camera, point, range);
    if (visibility <= 0) continue;
    const double angle =
        angle_between(point.towards(point.eye), point.towards(camera.pose.position));
    all.push_back({member, angle / visibility});
  }
  const auto kept = std::min(all.size(), static_cast<std::size_t>(count));
  const auto middle = all.begin() + static_cast<std::ptrdiff_t>(std::min(all.size(), kept + 1));
  std::partial_sort(all.begin(), middle, all.end(),
                    [](const CameraWeight& a, const CameraWeight& b) {
                      return a.share != b.share ? a.share < b.share : a.camera < b.camera;
                    });
  const double next = all.size() > kept ? all[kept].share : kInfinity;
  all.resize(kept);
  if (all.empty()) return all;
  // Avoids a division by 0 for a ray through a camera's own centre.
  const double least = 0.01 * (next < kInfinity ? next : all.back().share) + 1e-12;
  const bool alike = !(next > all.front().share);  // equal penalties: equal weights
  double sum = 0;
  for (CameraWeight& camera : all) {
    const double fall = alike ? 1 : 1 - camera.share / next;
    camera.share = fall / (camera.share + least);
    sum += camera.share;
  }
  for (CameraWeight& camera : all) camera.share /= sum;
  return all;
}

}  // namespace

ViewRays::ViewRays(const VirtualCamera& view)
    : view_(view), model_({"view", view.width, view.height, view.intrinsics, {}, {}, {}}) {}

std::optional<Vector3d> ViewRays::through(double x, double y) const {
  const auto ray = model_.unproject({x, y});
  if (!ray) return std::nullopt;
  return view_.pose.world_from_camera_rotation * *ray;
}

std::vector<Vector3d> ViewRays::bounding_rays() const {
  const int parts = model_.has_distortion() ? 32 : 1;
  std::vector<Vector3d> rays;
  for (int i = 0; i <= parts; ++i) {
    for (int j = 0; j <= parts; ++j) {
      const auto ray = through(static_cast<double>(view_.width) * i / parts,
                               static_cast<double>(view_.height) * j / parts);
      if (ray) rays.push_back(*ray);
    }
  }
  return rays;
}

BlendingField::BlendingField(const VirtualCamera& view, const rig::Rig& rig,
                             std::vector<int> members, const InverseDepthRange& range, int count)
    : columns_((view.width + kTile - 1) / kTile), rows_((view.height + kTile - 1) / kTile) {
  const ViewRays rays(view);
  const auto choose_at = [&](double x, double y) -> std::vector<CameraWeight> {
    const auto ray = rays.through(x, y);
    if (!ray) return {};
    // At infinity all cameras see a point in one direction; 1e6 m gives them different angles.
    const RayPoint point{view.pose.position, *ray,
                         std::max((range.farthest + range.nearest) / 2, 1e-6)};
    return choose(point, range, rig, members, count);
  };
  corners_.resize((columns_ + 1) * (rows_ + 1));
  raystage::parallel_for(0, rows_ + 1, [&](int row) {
    for (int column = 0; column <= columns_; ++column) {
      corners_[row * (columns_ + 1) + column] =
          choose_at(std::min(column * kTile, view.width), std::min(row * kTile, view.height));
    }
  });
  for (int row = 0; row < rows_; ++row) {
    for (int column = 0; column < columns_; ++column) {
      Tile tile;
      tile.left = column * kTile;
      tile.top = row * kTile;
      tile.right = std::min(tile.left + kTile, view.width);
      tile.bottom = std::min(tile.top + kTile, view.height);
      for (std::size_t i = 0; i < 4; ++i) {
        for (const CameraWeight& chosen :
             corner(column + static_cast<int>(i & 1), row + static_cast<int>(i >> 1))) {
          auto found = std::ranges::find(tile.cameras, chosen.camera, &TileCamera::camera);
          if (found == tile.cameras.end()) {
            found = tile.cameras.insert(found, {chosen.camera, {}});
          }
          found->share[i] = static_cast<float>(chosen.share);
        }
      }
      if (tile.cameras.empty()) {  // e.g. wider than the view of all cameras together
        for (const CameraWeight& chosen :
             choose_at((tile.left + tile.right) / 2.0, (tile.top + tile.bottom) / 2.0)) {
          tile.cameras.push_back({chosen.camera, {}});
          tile.cameras.back().share.fill(static_cast<float>(chosen.share));
        }
        tile.is_chosen_at_centre = true;
      }
      std::vector<CameraWeight> by_share;
      for (const TileCamera& camera : tile.cameras) {
        const auto& s = camera.share;
        by_share.push_back({camera.camera, s[0] + s[1] + s[2] + s[3]});
      }
      std::ranges::sort(by_share, [](const CameraWeight& a, const CameraWeight& b) {
        return a.share != b.share ? a.share > b.share : a.camera < b.camera;
      });
      by_share.resize(std::min(by_share.size(), static_cast<std::size_t>(count)));
      for (const CameraWeight& camera : by_share) tile.best.push_back(camera.camera);
      std::ranges::sort(tile.best);
      std::ranges::sort(tile.cameras, {}, &TileCamera::camera);
      tiles_.push_back(std::move(tile));
    }
  }
}

std::optional<BlendingField> BlendingField::complete(const VirtualCamera& view,
                                                     const LightFieldFrame& instant,
                                                     const InverseDepthRange& range, int count) {
  if (instant.present == instant.complete) return std::nullopt;
  const std::vector<int> present = instant.present_cameras();
  std::set<int> cameras(present.begin(), present.end());
  for (const rig::Topology::Cell& cell : instant.complete->cells) {
    std::ranges::copy_if(cell, std::inserter(cameras, cameras.end()),
                         [](int camera) { return camera >= 0; });
  }
  return BlendingField(view, *instant.rig, {cameras.begin(), cameras.end()}, range, count);
}

float BlendingField::share(const Tile& tile, const TileCamera& camera, int x, int y) {
  const float right =
      (static_cast<float>(x - tile.left) + 0.5F) / static_cast<float>(tile.right - tile.left);
  const float down =
      (static_cast<float>(y - tile.top) + 0.5F) / static_cast<float>(tile.bottom - tile.top);
  const auto& s = camera.share;
  const float upper = s[0] + right * (s[1] - s[0]), lower = s[2] + right * (s[3] - s[2]);
  return upper + down * (lower - upper);
}

void BlendingField::weights(const Tile& tile, const TileCamera& camera, int y,
                            std::span<float> of_row) {
  const float down =
      (static_cast<float>(y - tile.top) + 0.5F) / static_cast<float>(tile.bottom - tile.top);
  const auto& s = camera.share;
  const float left = s[0] + down * (s[2] - s[0]), right = s[1] + down * (s[3] - s[1]);
  const float step = (right - left) / static_cast<float>(tile.right - tile.left);
  for (int i = 0; i < static_cast<int>(of_row.size()); ++i) {
    of_row[i] = left + (static_cast<float>(i) + 0.5F) * step;
  }
}

float absent_camera_weight(const std::optional<BlendingField>& complete,
                           const LightFieldFrame& instant, int x, int y) {
  if (!complete) return 0;
  const BlendingField::Tile& tile = complete->tile_at(x, y);
  float absent = 0;
  for (const BlendingField::TileCamera& camera : tile.cameras) {
    if (!instant.is_present(camera.camera)) absent += BlendingField::share(tile, camera, x, y);
  }
  return std::min(absent, 1.0F);
}

namespace {

/// As inverse_depth_range_in_view(), of objects between spheres about the array. A ray meets them
/// at distances from its eye that differ from their radii by at most the eye's own.
InverseDepthRange range_around(const VirtualCamera& view, const rig::Rig& rig,
                               schemas::DepthRange scene) {
  const double eye = (view.pose.position - rig.centre()).norm();
  double longest = 1;  // metres along a ray per planar depth
  for (const Vector3d& ray : ViewRays(view).bounding_rays())
    longest = std::max(longest, ray.norm());
  const double nearest = scene.near - eye;
  const double limit = 4 / scene.near;
  return {1 / (scene.far + eye), nearest > 0 ? std::min(longest / nearest, limit) : limit};
}

}  // namespace

InverseDepthRange inverse_depth_range_in_view(const VirtualCamera& view, const rig::Rig& rig,
                                              schemas::DepthRange scene) {
  if (rig.looks_around()) return range_around(view, rig, scene);
  const Vector3d axis = rig.mean_viewing_direction();
  const double eye = (view.pose.position - rig.centre()).dot(axis);  // metres in front of the array
  const double to_near = scene.near - eye, to_far = scene.far - eye;
  double slowest = kInfinity, fastest = -kInfinity;  // metres away from the array per planar depth
  for (const Vector3d& ray : ViewRays(view).bounding_rays()) {
    const double speed = axis.dot(ray);
    slowest = std::min(slowest, speed);
    fastest = std::max(fastest, speed);
  }
  // A ray meets the planes `near` and `far` at inverse depths speed / distance. Speeds in the view
  // form an interval, because they are linear in the pixel.
  InverseDepthRange range{kInfinity, -kInfinity};
  const auto add = [&](double farthest, double nearest) {
    range.farthest = std::min(range.farthest, farthest);
    range.nearest = std::max(range.nearest, nearest);
  };
  const bool inside = to_near <= 0 && to_far >= 0;
  if (fastest > 0 && to_far > 0) {  // away from the array
    const double least = std::max(slowest, 0.0);
    add(least / to_far, inside ? kInfinity : fastest / to_near);
  }
  if (slowest < 0 && to_near < 0) {  // towards the array
    const double least = std::max(-fastest, 0.0);
    add(least / -to_near, inside ? kInfinity : slowest / to_far);
  }
  const double limit = 4 / scene.near;
  range.nearest = std::min(range.nearest, limit);
  return range;
}

double rounded_for_display(double planes) {
  const double unit = std::pow(10, std::floor(std::log10(planes))) / 2;
  return std::ceil(planes / unit) * unit;
}

SweepPlanes evenly_spaced_planes(const InverseDepthRange& range, int count) {
  if (count <= 1) return {1, (range.farthest + range.nearest) / 2, 0};
  return {count, range.farthest, (range.nearest - range.farthest) / (count - 1)};
}

double required_plane_count(const InverseDepthRange& range, const VirtualCamera& view,
                            const rig::Rig& rig, const BlendingField& field, double step_px) {
  constexpr int kParts = 8;
  const ViewRays rays(view);
  const std::vector<int> stations = rig::camera_stations(rig);
  // Largest disparity rate, in pixels per 1/m, between the cameras chosen at a pixel.
  const auto fastest_at = [&](double x, double y, const std::vector<CameraWeight>& chosen) {
    double fastest = 0;
    const auto ray = rays.through(x, y);
    if (!ray) return fastest;
    for (const CameraWeight& one : chosen) {
      const rig::Rig::Camera& camera = rig.cameras[one.camera];
      const rig::Rig::Camera* neighbour = nullptr;
      std::pair nearest{true, kInfinity};  // those of other stations first
      for (const CameraWeight& other : chosen) {
        const rig::Rig::Camera& candidate = rig.cameras[other.camera];
        const std::pair distance{stations[other.camera] == stations[one.camera],
                                 (candidate.pose.position - camera.pose.position).norm()};
        if (other.camera == one.camera || distance >= nearest) continue;
        nearest = distance;
        neighbour = &candidate;
      }
      if (neighbour == nullptr) continue;
      double before = 0;
      for (int part = 0; part <= kParts; ++part) {
        const double q = range.farthest + (range.nearest - range.farthest) * part / kParts;
        const RayPoint point{view.pose.position, *ray, q};
        const double parallax = angle_between(point.towards(camera.pose.position),
                                              point.towards(neighbour->pose.position));
        const schemas::Intrinsics& k = camera.model.intrinsics();
        if (part > 0) {
          fastest = std::max(fastest, std::abs(parallax - before) * std::max(k.fx, k.fy));
        }
        before = parallax;
      }
    }
    return fastest;
  };
  const auto fastest_of_tile = [&](const BlendingField::Tile& tile) {
    if (!tile.is_chosen_at_centre) return 0.0;
    std::vector<CameraWeight> chosen;
    for (const auto& camera : tile.cameras) chosen.push_back({camera.camera, 0});
    return fastest_at((tile.left + tile.right) / 2.0, (tile.top + tile.bottom) / 2.0, chosen);
  };
  std::vector<double> fastest_of_row(field.rows() + 1);
  raystage::parallel_for(0, field.rows() + 1, [&](int row) {
    double& fastest = fastest_of_row[row];
    for (int column = 0; column <= field.columns(); ++column) {
      fastest = std::max(fastest, fastest_at(std::min(column * BlendingField::kTile, view.width),
                                             std::min(row * BlendingField::kTile, view.height),
                                             field.corner(column, row)));
      if (row < field.rows() && column < field.columns()) {
        fastest = std::max(fastest, fastest_of_tile(field.tile(column, row)));
      }
    }
  });
  const double fastest = *std::ranges::max_element(fastest_of_row);
  return 1 + std::max(0.0, std::ceil(fastest * kParts / step_px - 1e-9));
}

}  // namespace raystage::render
