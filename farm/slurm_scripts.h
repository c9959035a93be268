// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "farm/job_folder.h"

namespace raystage::farm {

/// The batch scripts of a job for Slurm, as text for people and for sbatch. Scripts name their
/// folder once and everything else relative to it, so that any of them can be submitted by hand.

/// One word of a shell command, quoted where it must be.
std::string shell_quote(std::string_view text);

/// Name of the job's scheduler jobs of a stage, e.g. "s-1a2b3c4d.render"; of "start" as well.
std::string slurm_job_name(const FarmJobDocument& job, std::string_view stage);

/// "prepare.sbatch" and so on. Arguments of the script: the round, and the index of the stage's
/// task that is array index 0.
std::string batch_script(const FarmJobDocument& job, FarmStage stage);

/// "start.sbatch" queues round 1 once the job that JOB/after names is over; until then it runs
/// "start.sh", which queues it anew. A job before it that stays unqueued for 20 looks ends this
/// one.
std::string start_script(const FarmJobDocument& job, const std::string& job_before);
std::string queue_start_script(const FarmJobDocument& job);

/// "round-N.sh": queues a round's tasks, each chunk behind its instants, then the verification. Run
/// twice it queues nothing twice. Ids go to JOB/slurm.
std::string round_script(const FarmJobDocument& job, const FarmRound& round);

/// "preview.sh": queues the preview of what a round has completed.
std::string preview_script(const FarmJobDocument& job, int round);

/// Writes the scripts of all stages, and of the round. Throws Error (failed) for the disk.
void write_batch_scripts(const JobFolder& folder, const FarmJobDocument& job);
void write_round(const JobFolder& folder, const FarmJobDocument& job, const FarmRound& round);

/// What the scheduler is asked for: what the renderer is granted, and what else a process needs,
/// MiB.
int slurm_megabytes(const FarmResources& resources, double factor);

}  // namespace raystage::farm
