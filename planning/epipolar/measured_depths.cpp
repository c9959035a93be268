// SPDX-License-Identifier: Apache-2.0
#include "planning/epipolar/measured_depths.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <limits>
#include <utility>

#include "base/cancellation.h"
#include "base/error.h"
#include "planning/epipolar/instant_measurement.h"
#include "store/timeline.h"

namespace raystage::planning {
namespace {

constexpr std::size_t kMinPixels = 200;
// Shares of the measured pixels that are left out. Far ones are often reflections, which lie behind
// the surface that shows them; near ones are few where things are small, and matter most.
constexpr double kFarOutliers = 3e-3, kNearOutliers = 1e-5;
constexpr double kMargin = 0.04;        // of the range, at each end
constexpr double kMarginPixels = 0.25;  // at least that

/// Returns the farthest and the nearest of sorted inverse depths without outliers.
std::pair<double, double> without_outliers(const std::vector<double>& sorted) {
  const auto count_of = [&](double share) {
    return static_cast<std::size_t>(share * static_cast<double>(sorted.size()));
  };
  return {sorted[count_of(kFarOutliers)], sorted[sorted.size() - 1 - count_of(kNearOutliers)]};
}

schemas::DepthRange range_from(double farthest, double nearest) {
  constexpr double kInfinitelyFar = 1e-9;  // 1/m
  return {1 / nearest,
          farthest > kInfinitelyFar ? 1 / farthest : std::numeric_limits<double>::infinity()};
}

}  // namespace

bool DepthMeasurementOptions::is_valid(std::string* reason) const {
  if (instants >= 1 && cameras >= 2) return true;
  if (reason != nullptr) *reason = "at least one instant and two cameras are needed";
  return false;
}

MeasuredDepths measure_depths(const store::Take& take, const DepthMeasurementOptions& options,
                              const std::function<void(double)>& progress,
                              const std::stop_token& stop) {
  const std::string name = take.folder().string();
  std::string reason;
  if (!options.is_valid(&reason)) throw Error::bad_input(reason, name, "Correct the numbers");
  const store::Timeline timeline = store::read_timeline(take);
  if (timeline.ticks.empty()) {
    throw Error::bad_input("the take has no frames", name, "Choose a take with frames");
  }
  MeasuredDepths measured;
  measured.take = name;
  measured.stated = take.document().depth_range;
  const auto instants = std::min(static_cast<std::size_t>(options.instants), timeline.ticks.size());
  std::atomic<int> parts_done = 0;
  bool has_neighbours = false;
  const CancellationScope scope(stop);
  for (std::size_t i = 0; i < instants; ++i) {
    const std::size_t tick = instants == 1 ? timeline.ticks.size() / 2
                                           : i * (timeline.ticks.size() - 1) / (instants - 1);
    const store::FrameSelection& selection = timeline.ticks[tick];
    if (selection.present() == 0) continue;
    const InstantMeasurement instant(take, selection, static_cast<std::size_t>(options.cameras));
    const double per_pixel = instant.inverse_depth_per_pixel();
    if (per_pixel == 0) continue;
    has_neighbours = true;
    measured.instants.push_back(selection.time_ns);
    measured.cameras = std::max(measured.cameras, instant.cameras());
    measured.inverse_depth_per_pixel = per_pixel;
    if (measured.images.empty()) measured.images = instant.epipolar_images();
    const auto done = [&, parts = 2.0 * instant.cameras() * static_cast<double>(instants)] {
      const int count = ++parts_done;
      if (progress) progress(count / parts);
    };
    const std::vector<double> first = instant.first_pass(done);
    if (first.size() < kMinPixels) continue;
    const auto [farthest, nearest] = without_outliers(first);
    if (nearest <= 0) continue;
    const std::vector<double> second = instant.second_pass(range_from(farthest, nearest), done);
    measured.inverse_depths.insert(measured.inverse_depths.end(), second.begin(), second.end());
  }
  std::ranges::sort(measured.inverse_depths);
  if (!has_neighbours) {
    measured.no_range_because = "no camera has another one next to it or above it at that instant";
    return measured;
  }
  if (measured.inverse_depths.size() < kMinPixels) {
    measured.no_range_because =
        fmt::format("only {} of the pixels have a clear slope, {} are needed",
                    measured.inverse_depths.size(), kMinPixels);
    return measured;
  }
  auto [farthest, nearest] = without_outliers(measured.inverse_depths);
  const double margin =
      std::max(kMargin * (nearest - farthest), kMarginPixels * measured.inverse_depth_per_pixel);
  farthest -= margin;
  nearest += margin;
  constexpr double kLeast = 1e-9, kMost = 1e6;  // 1/m, what a take may state
  if (!(nearest > kLeast && nearest < kMost)) {
    measured.no_range_because =
        fmt::format("the nearest depth would be {:.3g} m, which is not credible", 1 / nearest);
    return measured;
  }
  measured.range = range_from(farthest, nearest);
  return measured;
}

}  // namespace raystage::planning
