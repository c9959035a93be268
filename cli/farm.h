// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "cli/command_line_parsing.h"
#include "cli/printing.h"

namespace raystage::cli {

Subcommand declare_farm_submit(CommandLine& farm);
Subcommand declare_farm_export(CommandLine& farm);
Subcommand declare_farm_status(CommandLine& farm);
Subcommand declare_farm_retry(CommandLine& farm);
Subcommand declare_farm_cancel(CommandLine& farm);
Subcommand declare_farm_logs(CommandLine& farm);
Subcommand declare_farm_doctor(CommandLine& farm);
Subcommand declare_farm_estimate(CommandLine& farm);
Subcommand declare_farm_task(CommandLine& farm);

/// Adds the positional JOB.
inline void add_job_argument(CommandLine& command, std::string& job) {
  command
      .option("JOB", job,
              "job folder (OUT/NAME.farm/job-0001), or the output (OUT/NAME.####.exr) for its "
              "newest job")
      .required();
}

}  // namespace raystage::cli
