// SPDX-License-Identifier: Apache-2.0
#include "farm/measurement.h"

#include <fmt/format.h>
#include <unistd.h>

#include <string>
#include <string_view>

#include "base/error.h"
#include "farm/attempts.h"
#include "farm/child_process.h"
#include "farm/task_commands.h"

namespace raystage::farm {

std::optional<FarmAttempt::End> measure_frame(const Measurement& measurement,
                                              const std::stop_token& stop) {
  FarmAttempt attempt;
  attempt.stage = "measure";
  attempt.node = node_name();
  attempt.process = getpid();
  attempt.frames = std::to_string(measurement.frame);
  attempt.started_utc = utc_now();
  record_attempt_start(measurement.folder, attempt);
  ChildOptions child_options;
  child_options.log = attempt_log(measurement.folder, attempt);
  child_options.stop = stop;
  std::string last;
  bool rendered = true;
  child_options.line = [&](std::string_view line) {
    if (!line.starts_with("Progress: ")) last = line;
    if (line.starts_with("0 of 1 frames rendered")) rendered = false;
  };
  const ChildResult child = run_child(render_command(measurement.job, measurement.shot, 0,
                                                     attempt.frames, measurement.job.existing, 1),
                                      child_options);
  FarmAttempt::End end;
  end.result = child.exit_code == 0 ? AttemptResult::kDone : AttemptResult::kFailed;
  end.exit_code = child.exit_code;
  end.wall_seconds = child.wall_seconds;
  end.cpu_seconds = child.cpu_seconds;
  end.peak_memory_bytes = child.peak_memory_bytes;
  end.ended_utc = utc_now();
  attempt.end = end;
  record_attempt_end(measurement.folder, attempt);
  if (child.exit_code == 0) return rendered ? std::optional(end) : std::nullopt;
  const std::string what =
      fmt::format("the first frame (frame {}) cannot be rendered: {}", measurement.frame, last);
  const std::string advice = "Correct the cause, or submit without measuring the first frame";
  throw child.exit_code == 2 ? Error::bad_input(what, measurement.shot.string(), advice)
                             : Error::failed(what, measurement.shot.string(), advice);
}

}  // namespace raystage::farm
