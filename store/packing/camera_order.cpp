// SPDX-License-Identifier: Apache-2.0
#include "store/packing/camera_order.h"

#include <algorithm>
#include <limits>
#include <numeric>
#include <tuple>

namespace raystage::store {
namespace {

using Camera = rig::Rig::Camera;

std::vector<int> chain_of_nearest(const rig::Rig& rig) {
  const Eigen::Vector3d centre = rig.centre();
  const auto distance_to = [&](const Eigen::Vector3d& point, int camera) {
    return (rig.cameras[static_cast<std::size_t>(camera)].pose.position - point).squaredNorm();
  };
  std::vector<int> left(rig.cameras.size());
  std::iota(left.begin(), left.end(), 0);
  std::vector<int> order;
  auto next =
      std::ranges::max_element(left, {}, [&](int camera) { return distance_to(centre, camera); });
  while (next != left.end()) {
    order.push_back(*next);
    left.erase(next);
    const Eigen::Vector3d here = rig.cameras[static_cast<std::size_t>(order.back())].pose.position;
    next =
        std::ranges::min_element(left, {}, [&](int camera) { return distance_to(here, camera); });
  }
  return order;
}

Nanoseconds median_interval(std::span<const FrameRecord> frames) {
  if (frames.size() < 2) return std::numeric_limits<Nanoseconds>::max() / 4;
  std::vector<Nanoseconds> intervals;
  for (std::size_t i = 1; i < frames.size(); ++i) {
    intervals.push_back(frames[i].time_ns - frames[i - 1].time_ns);
  }
  const auto middle = intervals.begin() + static_cast<std::ptrdiff_t>(intervals.size() / 2);
  std::ranges::nth_element(intervals, middle);
  return *middle;
}

}  // namespace

std::vector<int> serpentine_order(const rig::Rig& rig) {
  const bool is_grid = std::ranges::all_of(
      rig.cameras, [](const Camera& camera) { return camera.row && camera.column; });
  if (!is_grid) return chain_of_nearest(rig);
  std::vector<int> order(rig.cameras.size());
  std::iota(order.begin(), order.end(), 0);
  std::ranges::stable_sort(order, {}, [&](int camera) {
    const Camera& place = rig.cameras[static_cast<std::size_t>(camera)];
    return std::tuple(*place.row, *place.row % 2 == 0 ? *place.column : -*place.column);
  });
  return order;
}

std::vector<std::vector<FrameRef>> frames_by_instant(const Take& take,
                                                     const std::vector<int>& cameras,
                                                     Nanoseconds first, Nanoseconds last) {
  std::vector<std::size_t> next(cameras.size());
  std::span<const FrameRecord> longest;
  const auto frames_of = [&](std::size_t i) { return take.archive(cameras[i]).frames(); };
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    if (frames_of(i).size() > longest.size()) longest = frames_of(i);
    while (next[i] < frames_of(i).size() && frames_of(i)[next[i]].time_ns < first) ++next[i];
  }
  const Nanoseconds reach = median_interval(longest) / 2;
  const auto time_of = [&](std::size_t i) {
    constexpr Nanoseconds kNever = std::numeric_limits<Nanoseconds>::max();
    if (next[i] == frames_of(i).size()) return kNever;
    const Nanoseconds time = frames_of(i)[next[i]].time_ns;
    return time > last ? kNever : time;
  };
  std::vector<std::vector<FrameRef>> instants;
  for (;;) {
    Nanoseconds earliest = std::numeric_limits<Nanoseconds>::max();
    for (std::size_t i = 0; i < cameras.size(); ++i) earliest = std::min(earliest, time_of(i));
    if (earliest == std::numeric_limits<Nanoseconds>::max()) return instants;
    std::vector<FrameRef>& instant = instants.emplace_back();
    for (std::size_t i = 0; i < cameras.size(); ++i) {
      const Nanoseconds time = time_of(i);
      if (time == std::numeric_limits<Nanoseconds>::max() || time - earliest > reach) continue;
      instant.push_back({cameras[i], static_cast<int>(next[i]++)});
    }
  }
}

}  // namespace raystage::store
