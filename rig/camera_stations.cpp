// SPDX-License-Identifier: Apache-2.0
// Groups camera centres into stations: merges along the minimum spanning tree of the centres, from
// the shortest edge on (single linkage). A group that is merged much later than its members were is
// a station. Input: n centres (world, metres), output: n indices. Cost: O(n^2) time, O(n) memory.
#include "rig/camera_stations.h"

#include <algorithm>
#include <cstddef>
#include <limits>
#include <numeric>

namespace raystage::rig {
namespace {

using Eigen::Vector3d;

/// The distances in a station are at most this share of that to the next centre outside.
constexpr double kLargestGap = 1.0 / 50;
/// Centres of a station that do not coincide: more are an array of their own.
constexpr int kMostViewpoints = 3;

struct TreeEdge {
  double length;
  int one, other;
};

/// Returns the minimum spanning tree of the centres, shortest edges first.
std::vector<TreeEdge> spanning_tree(std::span<const Vector3d> centres) {
  // Prim's algorithm: each centre outside of the tree knows the nearest one inside.
  std::vector<TreeEdge> outside;
  for (int i = 1; i < static_cast<int>(centres.size()); ++i) {
    outside.push_back({(centres[i] - centres[0]).norm(), 0, i});
  }
  std::vector<TreeEdge> tree;
  while (!outside.empty()) {
    const auto nearest = std::ranges::min_element(outside, {}, &TreeEdge::length);
    const TreeEdge edge = *nearest;
    tree.push_back(edge);
    *nearest = outside.back();
    outside.pop_back();
    for (TreeEdge& candidate : outside) {
      const double length = (centres[candidate.other] - centres[edge.other]).norm();
      if (length < candidate.length) candidate = {length, edge.other, candidate.other};
    }
  }
  std::ranges::stable_sort(tree, {}, &TreeEdge::length);
  return tree;
}

/// Groups of indices, each known by its lowest one.
class Groups {
 public:
  explicit Groups(std::size_t count) : first_(count) { std::iota(first_.begin(), first_.end(), 0); }
  int first_of(int i) {
    while (first_[i] != i) i = first_[i] = first_[first_[i]];
    return i;
  }
  void join(int one, int other) {
    const auto [lower, higher] = std::minmax({first_of(one), first_of(other)});
    first_[higher] = lower;
  }

 private:
  std::vector<int> first_;
};

/// Returns by edge of the tree whether it joins centres of one station.
std::vector<char> edges_of_stations(std::span<const TreeEdge> tree, std::size_t count) {
  struct Merge {
    int viewpoints = 1;  ///< of the merged group
    int next = -1;       ///< the merge that takes up the group
  };
  std::vector<Merge> merges(tree.size());
  std::vector<int> last_merge(count, -1);  // by the first of a group
  Groups groups(count);
  for (int k = 0; k < static_cast<int>(tree.size()); ++k) {
    int viewpoints = tree[k].length > 0 ? 0 : -1;
    for (const int member : {tree[k].one, tree[k].other}) {
      const int merge = last_merge[groups.first_of(member)];
      viewpoints += merge < 0 ? 1 : merges[merge].viewpoints;
      if (merge >= 0) merges[merge].next = k;
    }
    merges[k].viewpoints = viewpoints;
    groups.join(tree[k].one, tree[k].other);
    last_merge[groups.first_of(tree[k].one)] = k;
  }
  std::vector<char> joins(tree.size(), 0);
  for (std::size_t k = tree.size(); k-- > 0;) {
    const int next = merges[k].next;
    const bool is_station = next >= 0 && merges[k].viewpoints <= kMostViewpoints &&
                            tree[k].length <= kLargestGap * tree[next].length;
    joins[k] = tree[k].length == 0 || is_station || (next >= 0 && joins[next] != 0);
  }
  return joins;
}

std::vector<Vector3d> centres_of(const Rig& rig) {
  std::vector<Vector3d> centres;
  for (const Rig::Camera& camera : rig.cameras) centres.push_back(camera.pose.position);
  return centres;
}

}  // namespace

std::vector<int> camera_stations(std::span<const Vector3d> centres) {
  const std::vector<TreeEdge> tree = spanning_tree(centres);
  const std::vector<char> joins = edges_of_stations(tree, centres.size());
  Groups stations(centres.size());
  for (std::size_t k = 0; k < tree.size(); ++k) {
    if (joins[k] != 0) stations.join(tree[k].one, tree[k].other);
  }
  std::vector<int> firsts(centres.size());
  for (std::size_t i = 0; i < firsts.size(); ++i)
    firsts[i] = stations.first_of(static_cast<int>(i));
  return firsts;
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
