// SPDX-License-Identifier: Apache-2.0
#include "render/automatic/automatic.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "render/automatic/left_out_camera.h"
#include "rig/sampling_limits.h"

namespace raystage {
namespace {

/// What a frame costs on the two threads that Target::seconds_per_frame speaks of.
double seconds_per_frame(const Candidate& candidate, const ViewRequest& request) {
  const double pixels = static_cast<double>(request.view.width) * request.view.height;
  return candidate.pixel_ns * 1e-9 * pixels / 2 +
         candidate.instant_seconds_per_camera * request.instant.take->camera_count();
}

double longest_focal_length(const Rig& rig) {
  double longest = 0;
  for (const Rig::Camera& camera : rig.cameras) {
    longest = std::max({longest, camera.model.intrinsics().fx, camera.model.intrinsics().fy});
  }
  return longest;
}

std::string in_time(double seconds) {
  return seconds < 1 ? fmt::format("{:.0f} ms a frame", seconds * 1e3)
                     : fmt::format("{:.1f} s a frame", seconds);
}

}  // namespace

Choice choose(std::span<const Candidate> candidates, const Target& target,
              const ViewRequest& request) {
  const Instant& instant = request.instant;
  const auto range = instant.take->document().depth_range;
  if (!range) {
    return {0, fmt::format("{}: the take has no depth range, which the others need",
                           candidates[0].label)};
  }
  const double spacing = camera_spacing(*instant.rig, *instant.complete);
  const double focal_length = longest_focal_length(*instant.rig);
  if (disparity_range(focal_length, spacing, *range) <= kAliasFreeDisparity) {
    return {0, fmt::format("{}: cameras {:.3g} mm apart, and up to {:.3g} mm a single plane is "
                           "free of ghosts (eq. 2.1)",
                           candidates[0].label, spacing * 1e3,
                           largest_alias_free_spacing(focal_length, *range) * 1e3)};
  }

  std::vector<std::size_t> in_reach;  // from the least to the most accurate
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    if (target.seconds_per_frame > 0 &&
        seconds_per_frame(candidates[i], request) > target.seconds_per_frame) {
      continue;
    }
    in_reach.push_back(i);
  }
  if (in_reach.empty()) {
    std::size_t cheapest = 0;
    for (std::size_t i = 1; i < candidates.size(); ++i) {
      if (seconds_per_frame(candidates[i], request) <
          seconds_per_frame(candidates[cheapest], request)) {
        cheapest = i;
      }
    }
    return {cheapest, fmt::format("{}: nothing takes less than {}, this is the quickest",
                                  candidates[cheapest].label,
                                  in_time(seconds_per_frame(candidates[cheapest], request)))};
  }
  const std::size_t best = in_reach.back();
  const std::string best_takes = in_time(seconds_per_frame(candidates[best], request));
  if (!(target.psnr_db > 0)) {
    return {best,
            target.seconds_per_frame > 0
                ? fmt::format("{}: the most accurate within {}, {}", candidates[best].label,
                              in_time(target.seconds_per_frame), best_takes)
                : fmt::format("{}: the most accurate, {}", candidates[best].label, best_takes)};
  }
  std::ranges::sort(in_reach, {},
                    [&](std::size_t i) { return seconds_per_frame(candidates[i], request); });
  double most_measured = -std::numeric_limits<double>::infinity();
  for (const std::size_t i : in_reach) {
    if (i == best) break;
    const double psnr =
        error_at_left_out_cameras(candidates[i].method, candidates[i].options, request);
    most_measured = std::max(most_measured, psnr);
    if (psnr >= target.psnr_db) {
      return {i, fmt::format("{}: {:.1f} dB at cameras left out, {:.1f} asked for, {}",
                             candidates[i].label, psnr, target.psnr_db,
                             in_time(seconds_per_frame(candidates[i], request)))};
    }
  }
  return {best,
          std::isfinite(most_measured)
              ? fmt::format("{}: the most accurate, {}; others give {:.1f} dB at most at "
                            "cameras left out, {:.1f} asked for",
                            candidates[best].label, best_takes, most_measured, target.psnr_db)
              : fmt::format("{}: the only one in reach, {}", candidates[best].label, best_takes)};
}

}  // namespace raystage
