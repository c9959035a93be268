// SPDX-License-Identifier: Apache-2.0
// Formats the results of a resynchronisation as JSON.
#include <nlohmann/json.hpp>
#include <numeric>

#include "schemas/former_names.h"
#include "store/processing/sync/resync_report.h"

namespace raystage::store {
namespace {

using Json = nlohmann::ordered_json;

Json camera_json(const CameraSync& camera, const CameraClock& clock, int absent) {
  Json lost = Json::array(), outliers = Json::array(), phase_steps = Json::array(),
       steps = Json::array();
  for (const LostRun& run : camera.lost) {
    lost.push_back({{"first", run.first},
                    {"count", run.count},
                    {"time_ns", run.time},
                    {"recorded", run.recorded},
                    {"start_up", run.start_up}});
  }
  for (const Outlier& outlier : camera.outliers) {
    Json json{{"frame", outlier.frame}, {"timestamp_ns", outlier.stamp}};
    json["error_ms"] =
        outlier.extra ? Json() : Json(static_cast<double>(outlier.deviation) / kNsPerMs);
    outliers.push_back(std::move(json));
  }
  for (const ClockStep& step : camera.phase_steps) {
    phase_steps.push_back({{"timestamp_ns", step.time_ns}, {"step_ns", step.step_ns}});
  }
  for (const ClockStep& step : clock.steps) {
    steps.push_back({{"timestamp_ns", step.time_ns}, {"step_ns", step.step_ns}});
  }
  Json json{{"id", camera.id}, {"node", camera.node}, {"frames", camera.frames}};
  json["regular"] = camera.regular;
  json["rate_hz"] = clock.period_ns > 0 ? Json(1e9 / clock.period_ns) : Json();
  json["period_ns"] = clock.period_ns > 0 ? Json(clock.period_ns) : Json();
  json["period_sigma_ppm"] = camera.period_sigma_ppm;
  json["phase_ns"] = clock.phase_ns;
  json["drift_ppm"] = clock.drift_ppm;
  json["jitter_ms"] = clock.jitter_ns / kNsPerMs;
  json["fitted_times"] = clock.fitted;
  json["offset_ns"] = clock.offset_ns;
  json["clock_steps"] = std::move(steps);
  json["phase_steps"] = std::move(phase_steps);
  json["absent_ticks"] = absent;
  json["dropped"] = camera.dropped();
  json["dropped_unrecorded"] = camera.lost_unrecorded();
  json["lost_at_start_up"] = camera.lost_at_start_up();
  json["lost"] = std::move(lost);
  json["outliers"] = std::move(outliers);
  json["late_start_ns"] = camera.late_start ? Json(*camera.late_start) : Json();
  json["early_end_ns"] = camera.early_end ? Json(*camera.early_end) : Json();
  return json;
}

Json flash_json(const FlashOffsets& flash) {
  Json groups = Json::array();
  for (const FlashOffset& group : flash.groups) {
    Json json{{"group", group.group}, {"offset_ms", static_cast<double>(group.offset) / kNsPerMs}};
    json["uncertainty_ms"] =
        group.uncertainty ? Json(static_cast<double>(*group.uncertainty) / kNsPerMs) : Json();
    json["cameras"] = group.cameras;
    json["flashes"] = group.flashes;
    groups.push_back(std::move(json));
  }
  return {{"times_ns", flash.flashes}, {"offsets", groups}};
}

}  // namespace

std::string resync_report_json(const ResyncResult& resync,
                               const std::optional<FlashOffsets>& flash) {
  const Timeline& timeline = resync.timeline;
  const TimelineStatistics statistics = timeline_statistics(timeline);
  Json absent = Json::object(), cameras = Json::array(), steps = Json::array();
  for (std::size_t c = 0; c < resync.cameras.size(); ++c) {
    if (statistics.absent[c] > 0) absent[resync.cameras[c].id] = statistics.absent[c];
    cameras.push_back(camera_json(resync.cameras[c], timeline.clocks[c], statistics.absent[c]));
  }
  for (const NodeClockStep& step : resync.steps) {
    steps.push_back({{"node", step.node},
                     {"time_ns", step.time},
                     {"step_ns", step.step},
                     {"cameras", step.cameras}});
  }
  Json json{{"fps", timeline.fps},
            {"tolerance_ns", timeline.tolerance},
            {"ticks", timeline.ticks.size()},
            {"first_ns", timeline.ticks.front().time_ns},
            {"last_ns", timeline.ticks.back().time_ns},
            {"spread_ms",
             {{"mean", statistics.mean_spread_ns / kNsPerMs},
              {"median", static_cast<double>(statistics.median_spread) / kNsPerMs},
              {"max", static_cast<double>(statistics.max_spread) / kNsPerMs}}},
            {"absent_total", std::reduce(statistics.absent.begin(), statistics.absent.end(), 0L)},
            {"absent", absent}};
  json["method"] = resync.method == ClockFitMethod::kEnvelope ? "envelope" : "least_squares";
  json["start_up_end_ns"] = resync.start_up_end ? Json(*resync.start_up_end) : Json();
  json["clock_steps"] = std::move(steps);
  Json pauses = Json::array();
  for (const RecordingPause& pause : resync.pauses) {
    pauses.push_back({{"node", pause.node}, {"begin_ns", pause.begin}, {"end_ns", pause.end}});
  }
  json["pauses"] = std::move(pauses);
  json["flash"] = flash ? flash_json(*flash) : Json();
  json["findings"] = resync_findings(resync, flash);
  json["cameras"] = std::move(cameras);
  constexpr schemas::FormerName kFormerNames[] = {{"timestamp_ns", "stamp_ns"},
                                                  {"error_ms", "by_ms"},
                                                  {"step_ns", "by_ns"},
                                                  {"phase_steps", "own_jumps"},
                                                  {"findings", "verdict"}};
  schemas::add_former_names(json, kFormerNames);
  return json.dump(2);
}

}  // namespace raystage::store
