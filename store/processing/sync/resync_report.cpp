// SPDX-License-Identifier: Apache-2.0
// Describes the results of a resynchronisation as sentences: rate, clock steps, losses, outliers.
#include "store/processing/sync/resync_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "store/processing/sync/lattice.h"

namespace raystage::store {
namespace {

constexpr double kSameRatePpm = 1000, kFewFramesPpm = 20'000;
constexpr std::int64_t kFewFrames = 32;
constexpr std::size_t kMaxNamed = 3;

double to_ms(Nanoseconds time) { return static_cast<double>(time) / kNsPerMs; }
double to_seconds(Nanoseconds time) { return static_cast<double>(time) / kNsPerS; }

std::string plural(std::int64_t count, std::string_view what) {
  return fmt::format("{} {}{}", count, what, count == 1 ? "" : "s");
}

// Returns a list such as "r0c1, r0c2 and 5 more".
std::string names(const std::vector<std::string>& ids) {
  std::string text;
  for (std::size_t i = 0; i < std::min(ids.size(), kMaxNamed); ++i) {
    text += (i == 0 ? "" : i + 1 == ids.size() ? " and " : ", ") + ids[i];
  }
  if (ids.size() > kMaxNamed) text += fmt::format(" and {} more", ids.size() - kMaxNamed);
  return text;
}

// Returns the rate that drifts are relative to, Hz, or 0.
double common_rate(const ResyncResult& resync) {
  std::vector<double> rates;
  for (const CameraClock& clock : resync.timeline.clocks) {
    if (clock.period_ns > 0) rates.push_back(kNsPerS / clock.period_ns);
  }
  std::ranges::sort(rates);
  return rates.empty() ? 0 : rates[(rates.size() - 1) / 2];
}

void add_rates(const ResyncResult& resync, std::vector<std::string>& findings) {
  const double common = common_rate(resync);
  if (common == 0) {
    findings.push_back(fmt::format(
        "{} cameras have too few frames to measure a rate: the ticks follow their time stamps.",
        resync.cameras.size()));
    return;
  }
  std::size_t same = 0;
  double largest = 0;
  std::vector<std::string> others, irregular;
  std::vector<double> jitters, sigmas;
  for (std::size_t c = 0; c < resync.cameras.size(); ++c) {
    const CameraClock& clock = resync.timeline.clocks[c];
    if (clock.period_ns <= 0) {
      irregular.push_back(resync.cameras[c].id);
      continue;
    }
    jitters.push_back(clock.jitter_ns / kNsPerMs);
    const double rate = kNsPerS / clock.period_ns;
    sigmas.push_back(resync.cameras[c].period_sigma_ppm);
    // A few frames determine neither a rate nor its standard error well.
    const double tolerance = resync.cameras[c].frames < kFewFrames ? kFewFramesPpm : kSameRatePpm;
    if (std::abs(rate / common - 1) * 1e6 < tolerance) {
      ++same;
      largest = std::max(largest, std::abs(clock.drift_ppm));
    } else {
      others.push_back(fmt::format("{} at {:.3f} Hz", resync.cameras[c].id, rate));
    }
  }
  const std::size_t all = resync.cameras.size();
  std::string text = all == 1 ? fmt::format("The camera runs at {:.3f} Hz", common)
                     : same == all
                         ? fmt::format("All {} cameras run at {:.3f} Hz", all, common)
                         : fmt::format("{} of {} cameras run at {:.3f} Hz", same, all, common);
  if (all > 1 && quantile(sigmas, 0.5) > kSameRatePpm) {
    text += " (uncertain: few frames)";
  } else if (all > 1 && largest < 0.5) {
    text += ", without a measurable difference";
  } else if (all > 1) {
    text += fmt::format(", each within {:.0f} ppm of it", std::ceil(largest));
  }
  text += fmt::format("; jitter of the time stamps: {:.2f} ms.", quantile(jitters, 0.5));
  findings.push_back(text);
  if (!others.empty()) findings.push_back("At another rate: " + names(others) + ".");
  if (!irregular.empty()) {
    findings.push_back(fmt::format("No constant rate: {}; {} time stamps are used unchanged.",
                                   names(irregular), irregular.size() == 1 ? "its" : "their"));
  }
}

void add_pauses(const ResyncResult& resync, std::vector<std::string>& findings) {
  for (const RecordingPause& pause : resync.pauses) {
    findings.push_back(fmt::format(
        "{} stopped at {:.2f} s and resumed after {:.2f} s. Every camera has a new phase since; "
        "frames of the pause do not count as lost.",
        pause.node.empty() ? "Recording" : "Recording on " + pause.node, to_seconds(pause.begin),
        to_seconds(pause.end - pause.begin)));
  }
}

void add_losses(const ResyncResult& resync, std::vector<std::string>& findings) {
  std::vector<std::pair<std::int64_t, const CameraSync*>> losers;
  std::int64_t dropped = 0, frames = 0, unrecorded = 0, start_up = 0;
  for (const CameraSync& camera : resync.cameras) {
    dropped += camera.dropped();
    frames += camera.frames;
    unrecorded += camera.lost_unrecorded();
    start_up += camera.lost_at_start_up();
    if (camera.dropped() > 0) losers.emplace_back(camera.dropped(), &camera);
  }
  if (resync.start_up_end) {
    findings.push_back(fmt::format("Start-up lasts until {:.2f} s: {} lost during it.",
                                   to_seconds(*resync.start_up_end), plural(start_up, "frame")));
  }
  std::ranges::stable_sort(losers, [](const auto& a, const auto& b) { return a.first > b.first; });
  const auto not_recorded = [](std::int64_t lost, std::int64_t unknown) {
    if (unknown == 0) return std::string(", all recorded in the journal");
    if (unknown == lost) return std::string(", none recorded in the journal");
    return fmt::format(", {} not recorded in the journal", unknown);
  };
  if (losers.empty()) {
    findings.push_back("No frame is missing between a camera's first and last.");
  } else if (losers.size() <= kMaxNamed) {
    for (const auto& [count, camera] : losers) {
      findings.push_back(fmt::format("Camera {} lost {}{}.", camera->id, plural(count, "frame"),
                                     not_recorded(count, camera->lost_unrecorded())));
    }
  } else {
    findings.push_back(
        fmt::format("{} cameras lost {} ({:.2f} %){}; camera {} lost most: {}.", losers.size(),
                    plural(dropped, "frame"),
                    100.0 * static_cast<double>(dropped) / static_cast<double>(frames + dropped),
                    not_recorded(dropped, unrecorded), losers[0].second->id, losers[0].first));
  }
}

void add_irregularities(const ResyncResult& resync, std::vector<std::string>& findings) {
  std::int64_t outliers = 0;
  const CameraSync* camera_of_worst = nullptr;
  const Outlier* worst = nullptr;
  std::vector<std::string> late, early;
  for (const CameraSync& camera : resync.cameras) {
    for (const Outlier& outlier : camera.outliers) {
      ++outliers;
      if (worst == nullptr || std::abs(outlier.deviation) > std::abs(worst->deviation)) {
        worst = &outlier;
        camera_of_worst = &camera;
      }
    }
    const bool alone = std::ranges::count(resync.cameras, camera.node, &CameraSync::node) == 1;
    for (const ClockStep& step : camera.phase_steps) {
      findings.push_back(fmt::format("Camera {} alone is {:.1f} ms {} from {:.2f} s on: {}.",
                                     camera.id, std::abs(to_ms(step.step_ns)),
                                     step.step_ns > 0 ? "later" : "earlier",
                                     to_seconds(step.time_ns),
                                     alone ? "it restarted or its clock stepped (the node has no "
                                             "other camera to compare); nothing is subtracted"
                                           : "it restarted; its node's clock has no step"));
    }
    if (camera.late_start) {
      late.push_back(fmt::format("{} at {:.2f} s", camera.id, to_seconds(*camera.late_start)));
    }
    if (camera.early_end) {
      early.push_back(fmt::format("{} at {:.2f} s", camera.id, to_seconds(*camera.early_end)));
    }
  }
  const std::string outlier_count =
      outliers == 1 ? "One frame is an outlier" : fmt::format("{} frames are outliers", outliers);
  if (worst != nullptr && worst->extra && worst->deviation == 0) {
    findings.push_back(fmt::format("{}, for example frame {} of {}.", outlier_count, worst->frame,
                                   camera_of_worst->id));
  } else if (worst != nullptr) {
    findings.push_back(fmt::format("{}; the largest deviation, of frame {} of {}, is {:.1f} ms {}.",
                                   outlier_count, worst->frame, camera_of_worst->id,
                                   std::abs(to_ms(worst->deviation)),
                                   worst->deviation > 0 ? "late" : "early"));
  }
  std::vector<std::string> unused;
  const TimelineStatistics statistics = timeline_statistics(resync.timeline);
  for (std::size_t c = 0; c < resync.cameras.size(); ++c) {
    const bool never = statistics.absent[c] == static_cast<int>(resync.timeline.ticks.size());
    if (never && resync.cameras[c].frames > 0) unused.push_back(resync.cameras[c].id);
  }
  if (!unused.empty()) {
    findings.push_back(
        fmt::format("In no tick: {}; ticks cover the time in which half of the cameras record.",
                    names(unused)));
  }
  if (!late.empty()) findings.push_back("Started late: " + names(late) + ".");
  if (!early.empty()) findings.push_back("Ended early: " + names(early) + ".");
}

}  // namespace

std::vector<std::string> resync_findings(const ResyncResult& resync,
                                         const std::optional<FlashOffsets>& flash) {
  std::vector<std::string> findings;
  add_rates(resync, findings);
  add_pauses(resync, findings);
  for (const NodeClockStep& step : resync.steps) {
    findings.push_back(fmt::format(
        "{} stepped {} by {:.1f} ms at {:.1f} s; the step is subtracted.",
        step.node.empty() ? "The clock of all cameras" : step.node + "'s clock",
        step.step > 0 ? "ahead" : "back", std::abs(to_ms(step.step)), to_seconds(step.time)));
  }
  if (flash) {
    std::vector<std::string> offsets;
    for (const FlashOffset& group : flash->groups) {
      offsets.push_back(group.uncertainty
                            ? fmt::format("{} {:+.1f} ms (+-{:.1f})", group.group,
                                          to_ms(group.offset), to_ms(*group.uncertainty))
                            : fmt::format("{} unknown (no flash detected)", group.group));
    }
    findings.push_back(fmt::format("Clock offsets by {}: {}.",
                                   flash->flashes.size() == 1
                                       ? std::string("one flash")
                                       : fmt::format("{} flashes", flash->flashes.size()),
                                   names(offsets)));
  }
  add_losses(resync, findings);
  add_irregularities(resync, findings);
  return findings;
}

}  // namespace raystage::store
