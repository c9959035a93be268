// SPDX-License-Identifier: Apache-2.0
// Predicts the duration of a job on a number of nodes with a bottleneck model: the throughput is
// that of the resource that saturates first. Source: Denning and Buzen, "The operational analysis
// of queueing network models", 1978, asymptotic bounds. Inputs: costs per frame and task in seconds
// and bytes, measured from the records of a job, and the rates of a site. Cost: constant per
// prediction; measured_costs() is linear in attempts and frames.
#include "farm/cost_model.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <map>
#include <numeric>

#include "compose/frame_range.h"
#include "compose/sequence_name.h"

namespace raystage::farm {
namespace {

constexpr std::array<std::string_view, 6> kLimitNames{
    "processors",         "too few tasks", "reading from storage",
    "writing to storage", "scheduler",     "submission and verification"};

struct StageTime {
  double seconds = 0;
  CostLimit limit = CostLimit::kProcessors;
  void at_least(double other, CostLimit by) {
    if (other > seconds) {
      seconds = other;
      limit = by;
    }
  }
};

/// Returns the time of `tasks` tasks of `seconds` each on `slots` slots.
StageTime stage_time(int tasks, double seconds, int slots, const SiteParameters& site) {
  StageTime time;
  if (tasks == 0) return time;
  const double task_s = seconds + site.start_latency_s;
  const double waves = std::ceil(static_cast<double>(tasks) / slots);
  time.seconds = waves * task_s;
  time.limit = tasks < 2 * slots ? CostLimit::kTooFewTasks : CostLimit::kProcessors;
  time.at_least(tasks / site.starts_per_s, CostLimit::kScheduler);
  return time;
}

double seconds_on(const JobCosts& job, const SiteParameters& site, int nodes,
                  ScalingPrediction& result) {
  const int slots = std::max(1, nodes * site.cores_per_node / job.threads);
  const StageTime prepare = stage_time(job.instants, job.solve_s, slots, site);
  StageTime render =
      stage_time(job.chunks, job.task_s + job.frame_s * job.frames / job.chunks, slots, site);
  render.at_least(job.frames * job.frame_read_bytes / site.storage_read_bytes_per_s,
                  CostLimit::kStorageRead);
  render.at_least(job.frames * job.frame_write_bytes / site.storage_write_bytes_per_s,
                  CostLimit::kStorageWrite);
  result.prepare_s = prepare.seconds;
  result.render_s = render.seconds;
  result.serial_s = job.frames * job.verify_s + site.start_latency_s;
  result.limit = render.limit;
  if (prepare.seconds > render.seconds) result.limit = prepare.limit;
  if (result.serial_s > std::max(prepare.seconds, render.seconds))
    result.limit = CostLimit::kSerial;
  return result.prepare_s + result.render_s + result.serial_s;
}

/// Returns the mean gap between tasks of a node in seconds, without gaps longer than three medians,
/// in which the node did other work. Compares times of the same node's clock only.
std::optional<double> mean_gap(const TaskAttempts& attempts) {
  constexpr double kLongest = 3;
  std::map<std::string, std::vector<std::pair<Nanoseconds, Nanoseconds>>> runs;  // by node
  for (const auto& [task, list] : attempts) {
    if (task.first != "render" && task.first != "prepare") continue;
    for (const schemas::FarmAttempt& attempt : list) {
      if (!attempt.end || !attempt.end->ended_utc) continue;
      runs[attempt.node].emplace_back(attempt.started_utc, *attempt.end->ended_utc);
    }
  }
  std::vector<double> gaps;
  for (auto& [node, times] : runs) {
    std::ranges::sort(times);
    for (std::size_t i = 1; i < times.size(); ++i) {
      // Tasks that overlap on a node have no gap.
      gaps.push_back(std::max(0.0, 1e-9 * (times[i].first - times[i - 1].second)));
    }
  }
  if (gaps.empty()) return std::nullopt;
  std::ranges::sort(gaps);
  const double longest = kLongest * gaps[gaps.size() / 2];
  gaps.erase(std::ranges::upper_bound(gaps, longest), gaps.end());
  return std::accumulate(gaps.begin(), gaps.end(), 0.0) / static_cast<double>(gaps.size());
}

/// The costs per frame.
constexpr std::array kPerFrame{
    &schemas::RenderStageCosts::light_fields_s, &schemas::RenderStageCosts::geometry_s,
    &schemas::RenderStageCosts::merge_s,        &schemas::RenderStageCosts::encode_s,
    &schemas::RenderStageCosts::write_s,        &schemas::RenderStageCosts::decode_s,
    &schemas::RenderStageCosts::read_bytes};

/// Adds stages in seconds per frame (`from`) to stages in seconds of all frames (`to`).
void add_stages(const schemas::RenderStageCosts& from, schemas::RenderStageCosts& to) {
  to.frames += from.frames;
  to.frames_in_flight = std::max(to.frames_in_flight, from.frames_in_flight);
  to.seconds += from.seconds;
  for (const auto cost : kPerFrame) to.*cost += from.frames * from.*cost;
}

std::string stages_text(const JobCosts& job) {
  const schemas::RenderStageCosts& stages = job.stages;
  if (stages.frames == 0) return "";
  const double write_rate = stages.write_s > 0 ? job.frame_write_bytes / stages.write_s * 1e-6 : 0;
  return fmt::format(
      "stages in s per frame, {} frames at once: light fields {:.4f} (decoding {:.4f} s CPU), "
      "geometry {:.4f},\nmerging {:.4f}, encoding {:.4f}, writing {:.4f} ({:.0f} MB/s)\n",
      stages.frames_in_flight, stages.light_fields_s, stages.decode_s, stages.geometry_s,
      stages.merge_s, stages.encode_s, stages.write_s, write_rate);
}

}  // namespace

std::string_view cost_limit_name(CostLimit limit) {
  return kLimitNames[static_cast<std::size_t>(limit)];
}

ScalingPrediction predict_scaling(const JobCosts& job, const SiteParameters& site, int nodes) {
  ScalingPrediction one, result;
  const double on_one = seconds_on(job, site, 1, one);
  result.nodes = nodes;
  result.seconds = seconds_on(job, site, nodes, result);
  result.efficiency = on_one / (result.seconds * nodes);
  return result;
}

std::optional<JobCosts> measured_costs(const schemas::FarmJobDocument& job,
                                       const TaskAttempts& attempts) {
  JobCosts costs;
  costs.chunks = static_cast<int>(job.chunks.size());
  costs.instants = static_cast<int>(job.instants.size());
  costs.threads = job.of(schemas::FarmStage::kRender).threads;
  costs.frames = 0;
  const compose::SequenceName name(job.output);
  double cpu = 0, wall = 0, bytes = 0, solve = 0;
  int timed = 0, files = 0, solved = 0, tasks = 0;
  std::error_code error;
  // Ignore tasks that found all of their frames complete.
  const bool any_rendered = std::ranges::any_of(attempts, [](const auto& task) {
    return task.second.back().end && task.second.back().end->rendering;
  });
  for (std::size_t i = 0; i < job.chunks.size(); ++i) {
    const std::vector<int> frames = compose::parse_frame_range(job.chunks[i].frames);
    costs.frames += static_cast<int>(frames.size());
    for (const int frame : frames) {
      const auto size = std::filesystem::file_size(name.path(frame), error);
      if (error) continue;
      bytes += static_cast<double>(size);
      ++files;
    }
    const auto found = attempts.find({"render", static_cast<int>(i)});
    if (found == attempts.end() || !found->second.back().end) continue;
    const schemas::FarmAttempt::End& end = *found->second.back().end;
    if (end.result != schemas::AttemptResult::kDone || (any_rendered && !end.rendering)) continue;
    cpu += end.cpu_seconds;
    wall += end.wall_seconds;
    // Some frames may have existed: the measured one, or those of an earlier attempt.
    timed += end.rendering ? end.rendering->frames : static_cast<int>(frames.size());
    ++tasks;
    if (end.rendering) add_stages(*end.rendering, costs.stages);
  }
  for (const auto& [task, list] : attempts) {
    const bool done = list.back().end && list.back().end->result == schemas::AttemptResult::kDone;
    if (!done) continue;
    if (task.first == "prepare") {
      solve += list.back().end->wall_seconds;
      ++solved;
    }
    if (task.first == "verify") costs.verify_s = list.back().end->wall_seconds;
  }
  if (timed == 0) return std::nullopt;
  costs.frame_cpu_s = cpu / timed;
  costs.frame_s = wall / timed;
  if (costs.stages.frames == timed) {
    // The logs state the time of the frames alone; the rest is overhead per task.
    costs.frame_s = costs.stages.seconds / timed;
    costs.task_s = (wall - costs.stages.seconds) / tasks;
  }
  if (costs.stages.frames > 0) {
    for (const auto cost : kPerFrame) costs.stages.*cost /= costs.stages.frames;
    costs.frame_read_bytes = costs.stages.read_bytes;
  }
  costs.gap_s = mean_gap(attempts);
  costs.verify_s /= std::max(1, costs.frames);
  if (files > 0) costs.frame_write_bytes = bytes / files;
  if (solved > 0) costs.solve_s = solve / solved;
  return costs;
}

std::string cost_text(const JobCosts& job, const SiteParameters& site, std::span<const int> nodes) {
  std::string text = fmt::format(
      "{} frames in {} tasks of {} threads, {} instants to prepare\n"
      "per frame {:.3f} s ({:.3f} s CPU), per instant {:.3f} s, overhead per task {:.3f} s, "
      "start latency {:.2f} s;\nper frame {:.2f} MB read and {:.2f} MB written\n{}\n"
      "{:>6} {:>12} {:>12} {:>12} {:>12} {:>11}  {}\n",
      job.frames, job.chunks, job.threads, job.instants, job.frame_s, job.frame_cpu_s, job.solve_s,
      job.task_s, site.start_latency_s, job.frame_read_bytes * 1e-6, job.frame_write_bytes * 1e-6,
      stages_text(job), "nodes", "prepare, s", "render, s", "serial, s", "total, s", "efficiency",
      "limited by");
  for (const int count : nodes) {
    const ScalingPrediction p = predict_scaling(job, site, count);
    text += fmt::format("{:>6} {:>12.1f} {:>12.1f} {:>12.1f} {:>12.1f} {:>10.0f}%  {}\n", p.nodes,
                        p.prepare_s, p.render_s, p.serial_s, p.seconds, 100 * p.efficiency,
                        cost_limit_name(p.limit));
  }
  return text;
}

}  // namespace raystage::farm
