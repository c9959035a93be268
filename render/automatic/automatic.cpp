// SPDX-License-Identifier: Apache-2.0
// Chooses a reconstruction method. It is the focal plane if the sampling theorem (thesis eq. 2.1)
// allows it; otherwise the cheapest candidate whose leave-one-out PSNR meets the target. If none
// meets it, it is the most accurate candidate within the time limit. Costs are linear in pixels and
// disparity. Cost: up to nine renderings per measured candidate.

#include "render/automatic/automatic.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "render/automatic/leave_one_out.h"
#include "rig/plenoptic_sampling.h"

namespace raystage::render {
namespace {

/// Least coverage of an acceptable reconstruction, whatever its PSNR; the same as in bench.
constexpr double kMinCovered = 0.85;

double longest_focal_length(const rig::Rig& rig) {
  double longest = 0;
  for (const rig::Rig::Camera& camera : rig.cameras) {
    longest = std::max({longest, camera.model.intrinsics().fx, camera.model.intrinsics().fy});
  }
  return longest;
}

/// The quantities on which the cost of a view depends.
struct Work {
  double pixels = 0, source_pixels = 0;  ///< of the view; of all cameras
  double disparity = 0;                  ///< disparity_range() between neighbours
};

Work work_of(const ViewRequest& request, double disparity) {
  const double samples = static_cast<double>(request.supersampling) * request.supersampling;
  Work work{static_cast<double>(request.view.width) * request.view.height / samples, 0, disparity};
  for (const int camera : request.instant.included_cameras) {
    const rig::CameraModel& model = request.instant.rig->cameras[camera].model;
    work.source_pixels += static_cast<double>(model.width()) * model.height();
  }
  return work;
}

/// Returns the seconds per frame on the two threads of QualityTarget::seconds_per_frame.
double seconds_per_frame(const MethodCandidate& c, const Work& work) {
  return 1e-9 / 2 *
         (work.pixels * (c.pixel_ns + c.disparity_ns * work.disparity) +
          work.source_pixels * c.instant_ns);
}

std::string in_time(double seconds) {
  return seconds < 1 ? fmt::format("{:.0f} ms per frame", seconds * 1e3)
                     : fmt::format("{:.1f} s per frame", seconds);
}

std::string measured(const LeaveOneOutQuality& quality) {
  std::string text =
      fmt::format("{:.1f} dB (mean {:.1f} - standard deviation {:.1f}) at {} left-out cameras",
                  quality.expected_db(), quality.mean_db, quality.stddev_db, quality.cameras);
  if (quality.covered < kMinCovered) {
    text += fmt::format(", but only {:.0f} % of their pixels covered", quality.covered * 100);
  }
  return text;
}

/// Chooses for a known depth range; `request` has the focal plane of eq. 2.2.
MethodChoice choose_by_range(std::span<const MethodCandidate> candidates,
                             const QualityTarget& target, const ViewRequest& request,
                             const schemas::DepthRange& scene) {
  const LightFieldFrame& instant = request.instant;
  const double spacing = rig::max_neighbour_baseline(*instant.rig, *instant.complete);
  const double focal_length = longest_focal_length(*instant.rig);
  const double disparity = rig::disparity_range(focal_length, spacing, scene);
  if (disparity <= rig::kMaxAliasFreeDisparity) {
    return {0, fmt::format("{}: the baseline is {:.3g} mm; up to {:.3g} mm, a single plane at "
                           "{:.4g} m shows no ghosts (eq. 2.1)",
                           candidates[0].label, spacing * 1e3,
                           rig::max_alias_free_baseline(focal_length, scene) * 1e3,
                           rig::optimal_focal_depth(scene))};
  }

  const Work work = work_of(request, disparity);
  std::vector<std::size_t> in_reach;  // from the least to the most accurate
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    if (target.seconds_per_frame > 0 &&
        seconds_per_frame(candidates[i], work) > target.seconds_per_frame) {
      continue;
    }
    in_reach.push_back(i);
  }
  if (in_reach.empty()) {
    std::size_t cheapest = 0;
    for (std::size_t i = 1; i < candidates.size(); ++i) {
      if (seconds_per_frame(candidates[i], work) < seconds_per_frame(candidates[cheapest], work)) {
        cheapest = i;
      }
    }
    return {cheapest, fmt::format("{}: the fastest candidate, {}, exceeds the time limit",
                                  candidates[cheapest].label,
                                  in_time(seconds_per_frame(candidates[cheapest], work)))};
  }
  const std::size_t best = in_reach.back();
  const std::string best_takes = in_time(seconds_per_frame(candidates[best], work));
  if (!(target.psnr_db > 0)) {
    return {best,
            target.seconds_per_frame > 0
                ? fmt::format("{}: the most accurate within {}, {}", candidates[best].label,
                              in_time(target.seconds_per_frame), best_takes)
                : fmt::format("{}: the most accurate, {}", candidates[best].label, best_takes)};
  }
  std::ranges::sort(in_reach, {},
                    [&](std::size_t i) { return seconds_per_frame(candidates[i], work); });
  std::optional<LeaveOneOutQuality> best_measured;
  for (const std::size_t i : in_reach) {
    if (i == best) break;
    const LeaveOneOutQuality quality =
        measure_leave_one_out_quality(*candidates[i].method, candidates[i].options, request);
    if (quality.cameras == 0) {
      return {best, fmt::format("{}: the most accurate within the time limit, {}; not measured: no "
                                "camera lies between three others",
                                candidates[best].label, best_takes)};
    }
    if (quality.covered >= kMinCovered && quality.expected_db() >= target.psnr_db) {
      return {i,
              fmt::format("{}: {}, target {:.1f} dB, {}", candidates[i].label, measured(quality),
                          target.psnr_db, in_time(seconds_per_frame(candidates[i], work))),
              true};
    }
    if (!best_measured || quality.expected_db() > best_measured->expected_db()) {
      best_measured = quality;
    }
  }
  return {best, best_measured
                    ? fmt::format("{}: the most accurate, {}; the best other one reaches {}",
                                  candidates[best].label, best_takes, measured(*best_measured))
                    : fmt::format("{}: the most accurate within the time limit, {}",
                                  candidates[best].label, best_takes)};
}

/// Chooses as choose(), without the note on a missing measurement.
MethodChoice chosen(std::span<const MethodCandidate> candidates, const QualityTarget& target,
                    const ViewRequest& request) {
  const auto range = target.scene ? target.scene : request.instant.take->document().depth_range;
  if (!range) {
    return {0, fmt::format("{}: the take has no depth range, which the other methods need",
                           candidates[0].label)};
  }
  // The sampling theorem (eq. 2.1) assumes this plane; any other has more out of focus.
  ViewRequest on_best = request;
  on_best.focal_plane =
      rig::fronto_parallel_plane(*request.instant.rig, rig::optimal_focal_depth(*range));
  MethodChoice choice = choose_by_range(candidates, target, on_best, *range);
  choice.focal_plane = on_best.focal_plane;
  return choice;
}

}  // namespace

MethodChoice choose(std::span<const MethodCandidate> candidates, const QualityTarget& target,
                    const ViewRequest& request) {
  MethodChoice choice = chosen(candidates, target, request);
  if (target.psnr_db > 0 && !choice.meets_target_leave_one_out) {
    choice.why += fmt::format("; its error was not measured and may miss the target of {:.1f} dB",
                              target.psnr_db);
  }
  return choice;
}

}  // namespace raystage::render
