// SPDX-License-Identifier: Apache-2.0
// Groups camera centres into stations by single-linkage clustering at a distance that depends on
// the spacing of the stations themselves: the two are found in turns, until the stations stay. The
// first distance is that to the second nearest neighbour, because the nearest one of most centres
// may be in the same station. Input: n centres (world, metres), output: n indices. Cost: centres
// are sorted along one axis and neighbours searched outwards from each: O(n^1.5) if they are
// spread over a surface, O(n^2) at most.
#include "rig/camera_stations.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numeric>

namespace raystage::rig {
namespace {

using Eigen::Vector3d;

constexpr double kStationReach = 0.05;  // of the median distance of nearest stations
constexpr double kPairReach = 0.03;     // of the median distance of second nearest centres

/// Centres in the order of a coordinate: that of the longest side of their bounding box.
class SortedCentres {
 public:
  explicit SortedCentres(std::span<const Vector3d> centres) : centres_(centres) {
    Vector3d least = Vector3d::Zero(), most = Vector3d::Zero();
    for (const Vector3d& centre : centres) {
      least = least.cwiseMin(centre - centres[0]);
      most = most.cwiseMax(centre - centres[0]);
    }
    (most - least).maxCoeff(&axis_);
    order_.resize(centres.size());
    std::iota(order_.begin(), order_.end(), 0);
    std::ranges::sort(order_, {}, [&](int i) { return centres_[i](axis_); });
  }

  /// Returns the median distance of a centre to its nearest (`rank` 0) or second nearest (1) other
  /// one; 0 if there is none.
  double median_distance(std::size_t rank) const {
    if (centres_.size() < rank + 2) return 0;
    std::vector<double> distances;
    for (std::size_t at = 0; at < order_.size(); ++at) distances.push_back(nearest_two(at)[rank]);
    const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
    std::ranges::nth_element(distances, middle);
    return *middle;
  }

  /// Returns by centre the first of those that are joined to it: at most `reach` apart, or by way
  /// of others.
  std::vector<int> joined(double reach) const {
    std::vector<int> first(centres_.size());
    std::iota(first.begin(), first.end(), 0);
    const auto root = [&](int i) {
      while (first[i] != i) i = first[i] = first[first[i]];
      return i;
    };
    for (std::size_t at = 0; at < order_.size(); ++at) {
      for (std::size_t other = at + 1; other < order_.size(); ++other) {
        const Vector3d offset = centres_[order_[other]] - centres_[order_[at]];
        if (offset(axis_) > reach) break;
        if (offset.norm() > reach) continue;
        const auto [lower, higher] = std::minmax({root(order_[at]), root(order_[other])});
        first[higher] = lower;
      }
    }
    for (std::size_t i = 0; i < first.size(); ++i) first[i] = root(static_cast<int>(i));
    return first;
  }

 private:
  /// Returns the distances of the centre at a place in the order to the two nearest other ones.
  std::array<double, 2> nearest_two(std::size_t at) const {
    constexpr double kNone = std::numeric_limits<double>::infinity();
    std::array<double, 2> nearest{kNone, kNone};
    // Returns false if neither this one nor those behind it can be nearer.
    const auto visit = [&](std::size_t other) {
      const Vector3d offset = centres_[order_[other]] - centres_[order_[at]];
      if (std::abs(offset(axis_)) >= nearest[1]) return false;
      const double distance = offset.norm();
      nearest[1] = std::min(nearest[1], std::max(nearest[0], distance));
      nearest[0] = std::min(nearest[0], distance);
      return true;
    };
    for (std::size_t other = at + 1; other < order_.size() && visit(other);) ++other;
    for (std::size_t other = at; other > 0 && visit(other - 1);) --other;
    return nearest;
  }

  std::span<const Vector3d> centres_;
  Eigen::Index axis_ = 0;
  std::vector<int> order_;
};

std::vector<Vector3d> first_centres(std::span<const Vector3d> centres,
                                    std::span<const int> stations) {
  std::vector<Vector3d> firsts;
  for (std::size_t i = 0; i < centres.size(); ++i) {
    if (stations[i] == static_cast<int>(i)) firsts.push_back(centres[i]);
  }
  return firsts;
}

std::vector<Vector3d> centres_of(const Rig& rig) {
  std::vector<Vector3d> centres;
  for (const Rig::Camera& camera : rig.cameras) centres.push_back(camera.pose.position);
  return centres;
}

}  // namespace

std::vector<int> camera_stations(std::span<const Vector3d> centres) {
  const SortedCentres all(centres);
  std::vector<int> stations = all.joined(0);
  const std::vector<Vector3d> distinct = first_centres(centres, stations);
  double reach = kPairReach * SortedCentres(distinct).median_distance(1);
  // The reach grows, or shrinks, from round to round: few are needed.
  constexpr int kMaxRounds = 16;
  for (int round = 0; round < kMaxRounds; ++round) {
    std::vector<int> next = all.joined(reach);
    if (round > 0 && next == stations) break;
    stations = std::move(next);
    const std::vector<Vector3d> firsts = first_centres(centres, stations);
    reach = kStationReach * SortedCentres(firsts).median_distance(0);
  }
  return stations;
}

std::vector<int> camera_stations(const Rig& rig) { return camera_stations(centres_of(rig)); }

std::vector<int> first_of_stations(std::span<const Vector3d> centres) {
  std::vector<int> all(centres.size());
  std::iota(all.begin(), all.end(), 0);
  const std::vector<int> stations = camera_stations(centres);
  std::vector<int> firsts = all;
  std::erase_if(firsts, [&](int i) { return stations[i] != i; });
  return firsts.size() < 3 ? all : firsts;
}

std::vector<double> nearest_baselines(const Rig& rig) {
  const std::vector<int> stations = camera_stations(rig);
  std::vector<double> nearest(rig.cameras.size(), std::numeric_limits<double>::infinity());
  for (std::size_t i = 0; i < nearest.size(); ++i) {
    for (std::size_t j = 0; j < nearest.size(); ++j) {
      if (stations[i] == stations[j]) continue;
      nearest[i] = std::min(nearest[i],
                            (rig.cameras[i].pose.position - rig.cameras[j].pose.position).norm());
    }
  }
  return nearest;
}

}  // namespace raystage::rig
