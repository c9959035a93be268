// SPDX-License-Identifier: Apache-2.0
// A bottleneck model (Denning and Buzen, "The operational analysis of queueing network models",
// 1978, asymptotic bounds): throughput is that of the resource that saturates first.
#include "farm/cost_model.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>

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

/// `tasks` of `cpu_s` processor seconds each on `slots` slots of `threads` cores.
StageTime stage_time(int tasks, double cpu_s, int threads, int slots, const SiteCosts& site) {
  StageTime time;
  if (tasks == 0) return time;
  const double task_s = cpu_s / threads + site.start_latency_s;
  const double waves = std::ceil(static_cast<double>(tasks) / slots);
  time.seconds = waves * task_s;
  time.limit = tasks < 2 * slots ? CostLimit::kTooFewTasks : CostLimit::kProcessors;
  time.at_least(tasks / site.starts_per_s, CostLimit::kScheduler);
  return time;
}

double seconds_on(const JobCosts& job, const SiteCosts& site, int nodes, Prediction& result) {
  const int slots = std::max(1, nodes * site.cores_per_node / job.threads);
  const StageTime prepare = stage_time(job.instants, job.solve_cpu_s, job.threads, slots, site);
  StageTime render =
      stage_time(job.chunks, job.task_cpu_s + job.frame_cpu_s * job.frames / job.chunks,
                 job.threads, slots, site);
  render.at_least(job.frames * job.frame_read_bytes / site.storage_read_bytes_per_s,
                  CostLimit::kStorageRead);
  render.at_least(job.frames * job.frame_write_bytes / site.storage_write_bytes_per_s,
                  CostLimit::kStorageWrite);
  result.prepare_s = prepare.seconds;
  result.render_s = render.seconds;
  result.serial_s = job.submit_s + job.frames * job.verify_s + site.start_latency_s;
  result.limit = render.limit;
  if (prepare.seconds > render.seconds) result.limit = prepare.limit;
  if (result.serial_s > std::max(prepare.seconds, render.seconds))
    result.limit = CostLimit::kSerial;
  return result.prepare_s + result.render_s + result.serial_s;
}

}  // namespace

std::string_view cost_limit_name(CostLimit limit) {
  return kLimitNames[static_cast<std::size_t>(limit)];
}

Prediction predict(const JobCosts& job, const SiteCosts& site, int nodes) {
  Prediction one, result;
  const double on_one = seconds_on(job, site, 1, one);
  result.nodes = nodes;
  result.seconds = seconds_on(job, site, nodes, result);
  result.efficiency = on_one / (result.seconds * nodes);
  return result;
}

std::optional<JobCosts> measured_costs(const FarmJobDocument& job, const TaskAttempts& attempts) {
  JobCosts costs;
  costs.chunks = static_cast<int>(job.chunks.size());
  costs.instants = static_cast<int>(job.instants.size());
  costs.threads = job.of(FarmStage::kRender).threads;
  costs.frames = 0;
  const SequenceName name(job.output);
  double cpu = 0, bytes = 0, solve_cpu = 0;
  int timed = 0, files = 0, solved = 0;
  std::error_code error;
  for (std::size_t i = 0; i < job.chunks.size(); ++i) {
    const std::vector<int> frames = parse_frame_range(job.chunks[i].frames);
    costs.frames += static_cast<int>(frames.size());
    for (const int frame : frames) {
      const auto size = std::filesystem::file_size(name.path(frame), error);
      if (error) continue;
      bytes += static_cast<double>(size);
      ++files;
    }
    const auto found = attempts.find({"render", static_cast<int>(i)});
    if (found == attempts.end() || !found->second.back().end) continue;
    const FarmAttempt::End& end = *found->second.back().end;
    if (end.result != AttemptResult::kDone) continue;
    cpu += end.cpu_seconds;
    timed += static_cast<int>(frames.size());
  }
  for (const auto& [task, list] : attempts) {
    const bool done = list.back().end && list.back().end->result == AttemptResult::kDone;
    if (!done) continue;
    if (task.first == "prepare") {
      solve_cpu += list.back().end->cpu_seconds;
      ++solved;
    }
    if (task.first == "verify") costs.verify_s = list.back().end->wall_seconds;
  }
  if (timed == 0) return std::nullopt;
  costs.frame_cpu_s = cpu / timed;
  costs.verify_s /= std::max(1, costs.frames);
  if (files > 0) costs.frame_write_bytes = bytes / files;
  if (solved > 0) costs.solve_cpu_s = solve_cpu / solved;
  return costs;
}

std::string cost_text(const JobCosts& job, const SiteCosts& site, std::span<const int> nodes) {
  std::string text = fmt::format(
      "{} frames in {} tasks of {} threads, {} instants to prepare\n"
      "processor seconds: {:.3f} a frame, {:.3f} an instant, {:.3f} a task; {:.2f} MB read and "
      "{:.2f} "
      "MB written a frame\n\n{:>6} {:>12} {:>12} {:>12} {:>12} {:>11}  {}\n",
      job.frames, job.chunks, job.threads, job.instants, job.frame_cpu_s, job.solve_cpu_s,
      job.task_cpu_s, job.frame_read_bytes * 1e-6, job.frame_write_bytes * 1e-6, "nodes",
      "prepare, s", "render, s", "serial, s", "in all, s", "efficiency", "limited by");
  for (const int count : nodes) {
    const Prediction p = predict(job, site, count);
    text += fmt::format("{:>6} {:>12.1f} {:>12.1f} {:>12.1f} {:>12.1f} {:>10.0f}%  {}\n", p.nodes,
                        p.prepare_s, p.render_s, p.serial_s, p.seconds, 100 * p.efficiency,
                        cost_limit_name(p.limit));
  }
  return text;
}

}  // namespace raystage::farm
