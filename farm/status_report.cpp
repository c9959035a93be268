// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>

#include "base/printable.h"
#include "charts/html_page.h"
#include "compose/frame_range.h"
#include "farm/status.h"
#include "schemas/json_text.h"

namespace raystage::farm {
namespace {

using OrderedJson = nlohmann::ordered_json;

std::string time_text(double seconds) {
  constexpr double kMinute = 60;
  if (seconds < kMinute) return fmt::format("{:.1f} s", seconds);
  const auto s = static_cast<long long>(seconds + 0.5);
  return fmt::format("{}:{:02}:{:02}", s / 3600, s / 60 % 60, s % 60);
}

/// Returns the number of a stage's tasks by state, e.g. "3 done, 1 running".
std::string counts_text(const JobStatus& status, const std::string& stage) {
  std::map<TaskState, int> counts;
  for (const TaskStatus& task : status.tasks) {
    if (task.stage == stage) ++counts[task.state];
  }
  std::string text;
  for (const auto& [state, count] : counts) {
    text += fmt::format("{}{} {}", text.empty() ? "" : ", ", count, task_state_name(state));
  }
  return text;
}

std::vector<std::string> stages_of(const JobStatus& status) {
  std::vector<std::string> stages;
  for (const TaskStatus& task : status.tasks) {
    if (std::ranges::find(stages, task.stage) == stages.end()) stages.push_back(task.stage);
  }
  return stages;
}

std::string task_line(const TaskStatus& task) {
  std::string line = fmt::format("{} {}", task.stage, task.index);
  if (!task.frames.empty()) line += fmt::format(" (frames {})", task.frames);
  line += fmt::format(": {}", task_state_name(task.state));
  if (task.state == TaskState::kRunning) line += fmt::format(" {} %", task.percent);
  if (!task.node.empty()) line += " on " + printable_in_line(task.node);
  if (task.attempts.size() > 1) line += fmt::format(", attempt {}", task.attempts.size());
  if (!task.reason.empty()) line += ": " + printable_in_line(task.reason);
  return line;
}

bool deserves_a_line(const TaskStatus& task) {
  return task.state == TaskState::kRunning || task.state == TaskState::kFailed ||
         task.state == TaskState::kLost;
}

OrderedJson json_from(const schemas::FarmAttempt& attempt) {
  return OrderedJson::parse(schemas::format_farm_attempt(attempt));
}

constexpr std::string_view kStyle = R"(
.bar{display:flex;height:1.1rem;border-radius:4px;overflow:hidden;background:#8883;margin:.3rem 0 1rem}
.bar i{display:block}.done{background:#3a9d5d}.running{background:#3b82c4}.failed,.lost{background:#d1495b}
.waiting,.unknown,.not_queued{background:#8885}
table{border-collapse:collapse;width:100%;font-variant-numeric:tabular-nums}
td,th{text-align:left;padding:.2rem .6rem;border-bottom:1px solid #8883;vertical-align:top}
td b{display:inline-block;width:.7rem;height:.7rem;border-radius:2px;margin-right:.4rem}
img{max-width:100%})";

std::string css_class(TaskState state) {
  std::string name(task_state_name(state));
  std::ranges::replace(name, ' ', '_');
  return name;
}

std::string bar_of(const JobStatus& status, const std::string& stage) {
  std::string bar = "<div class=\"bar\">";
  for (const TaskStatus& task : status.tasks) {
    if (task.stage != stage) continue;
    const auto weight = task.frames.empty() ? 1 : compose::parse_frame_range(task.frames).size();
    bar += fmt::format("<i class=\"{}\" style=\"flex:{}\" title=\"{}\"></i>", css_class(task.state),
                       weight, charts::escape_html(task_line(task)));
  }
  return bar + "</div>";
}

std::string table_of(const JobStatus& status) {
  std::string rows =
      "<table><tr><th>task</th><th>frames</th><th>state</th><th>node</th><th>attempts</th>"
      "<th>time</th><th>memory</th><th>reason</th></tr>";
  for (const TaskStatus& task : status.tasks) {
    const schemas::FarmAttempt* last = task.attempts.empty() ? nullptr : &task.attempts.back();
    const bool has_end = last != nullptr && last->end;
    rows += fmt::format(
        "<tr><td>{} {}</td><td>{}</td><td><b class=\"{}\"></b>{}{}</td><td>{}</td><td>{}</td>"
        "<td>{}</td><td>{}</td><td>{}</td></tr>",
        task.stage, task.index, charts::escape_html(task.frames), css_class(task.state),
        task_state_name(task.state),
        task.state == TaskState::kRunning ? fmt::format(" {} %", task.percent) : "",
        charts::escape_html(task.node), task.attempts.size(),
        has_end ? time_text(last->end->wall_seconds) : "",
        has_end ? fmt::format("{:.2f} GB", last->end->peak_memory_bytes * 1e-9) : "",
        charts::escape_html(task.reason));
  }
  return rows + "</table>";
}

std::string summary_text(const JobStatus& status) {
  std::string text = fmt::format("{} of {} frames done", status.frames_done, status.frames);
  if (status.frames_failed > 0) text += fmt::format(", {} failed", status.frames_failed);
  if (status.seconds_left) text += ", about " + time_text(*status.seconds_left) + " left";
  return text;
}

}  // namespace

std::string status_text(const JobStatus& status, bool all_tasks) {
  std::string text =
      fmt::format("job {}: {}{}\n", status.job.id, job_state_name(status.state),
                  status.reason.empty() ? "" : " (" + printable_in_line(status.reason) + ")");
  text += fmt::format("folder {}\n{}\n", status.job.folder, summary_text(status));
  if (!status.missing_frames.empty()) {
    text += fmt::format("missing: frames {}\n", status.missing_frames);
  }
  if (!status.frames_below_coverage.empty()) {
    text += fmt::format("below the least coverage: frames {}\n", status.frames_below_coverage);
  }
  if (!status.frames_with_rot.empty()) {
    text +=
        fmt::format("cameras with rotten frames are absent: frames {}\n", status.frames_with_rot);
  }
  for (const std::string& stage : stages_of(status)) {
    text += fmt::format("{:<8} {}\n", stage, counts_text(status, stage));
  }
  if (status.rounds > 1) text += fmt::format("round {}\n", status.rounds);
  for (const auto& [node, reason] : status.excluded_nodes) {
    text += fmt::format("node {} is excluded: {}\n", printable_in_line(node),
                        printable_in_line(reason));
  }
  for (const TaskStatus& task : status.tasks) {
    if (all_tasks || deserves_a_line(task)) text += "  " + task_line(task) + "\n";
  }
  return text;
}

std::string status_json(const JobStatus& status) {
  OrderedJson json{{"job", status.job.id},
                   {"folder", status.job.folder},
                   {"engine", schemas::farm_engine_name(status.job.engine)},
                   {"state", job_state_name(status.state)},
                   {"reason", status.reason},
                   {"frames", status.frames},
                   {"frames_done", status.frames_done},
                   {"frames_failed", status.frames_failed},
                   {"missing_frames", status.missing_frames},
                   {"frames_below_coverage", status.frames_below_coverage},
                   {"frames_with_rot", status.frames_with_rot},
                   {"rounds", status.rounds},
                   {"cpu_seconds", status.cpu_seconds},
                   {"light_field_frames_solved", status.light_field_frames_estimated}};
  if (status.seconds_left) json["seconds_left"] = *status.seconds_left;
  OrderedJson& excluded = json["excluded_nodes"] = OrderedJson::object();
  for (const auto& [node, reason] : status.excluded_nodes) excluded[node] = reason;
  OrderedJson& tasks = json["tasks"] = OrderedJson::array();
  for (const TaskStatus& task : status.tasks) {
    OrderedJson object{{"stage", task.stage},
                       {"index", task.index},
                       {"state", task_state_name(task.state)},
                       {"frames", task.frames},
                       {"node", task.node},
                       {"percent", task.state == TaskState::kDone ? 100 : task.percent},
                       {"reason", task.reason},
                       {"attempts", OrderedJson::array()}};
    for (const schemas::FarmAttempt& attempt : task.attempts) {
      object["attempts"].push_back(json_from(attempt));
    }
    tasks.push_back(std::move(object));
  }
  return schemas::dump_json(json) + "\n";
}

std::string status_html(const JobStatus& status, const JobFolder& folder) {
  std::string bars;
  for (const std::string& stage : stages_of(status)) {
    bars += fmt::format("<p>{}: {}</p>{}", stage, charts::escape_html(counts_text(status, stage)),
                        bar_of(status, stage));
  }
  std::string summary = summary_text(status);
  if (!status.missing_frames.empty()) summary += "; missing: frames " + status.missing_frames;
  if (!status.frames_below_coverage.empty()) {
    summary += "; below the least coverage: frames " + status.frames_below_coverage;
  }
  if (!status.frames_with_rot.empty()) {
    summary += "; cameras with rotten frames are absent: frames " + status.frames_with_rot;
  }
  std::string body =
      charts::html_section("Progress", charts::escape_html(summary), bars) +
      charts::html_section("Tasks", "The last attempt of each. Logs: raystage farm logs",
                           table_of(status));
  if (!status.excluded_nodes.empty()) {
    std::string nodes;
    for (const auto& [node, reason] : status.excluded_nodes) {
      nodes +=
          fmt::format("<li>{}: {}</li>", charts::escape_html(node), charts::escape_html(reason));
    }
    body += charts::html_section("Excluded nodes", "", "<ul>" + nodes + "</ul>");
  }
  const std::string subtitle =
      fmt::format("{}{} · {}", job_state_name(status.state),
                  status.reason.empty() ? "" : " (" + status.reason + ")", folder.path().string());
  return charts::html_page("Farm job " + status.job.id, subtitle, body, kStyle);
}

}  // namespace raystage::farm
