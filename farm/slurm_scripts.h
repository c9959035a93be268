// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "farm/job_folder.h"

namespace raystage::farm {

/// The batch scripts of a job for Slurm, as text for people and for sbatch. Scripts name their
/// folder once and everything else relative to it, so that any of them can be submitted by hand.

/// Returns the text as one word of a shell command, quoted if necessary.
std::string shell_quote(std::string_view text);

/// Returns the name of the job's Slurm jobs of a stage (or "start"), e.g. "s-1a2b3c4d.render".
std::string slurm_job_name(const schemas::FarmJobDocument& job, std::string_view stage);

/// Returns the batch script of a stage ("prepare.sbatch" and so on). Its arguments are the round
/// and the index of the stage's task that is array index 0.
std::string batch_script(const schemas::FarmJobDocument& job, schemas::FarmStage stage);

/// Return "start.sbatch" and "start.sh". start.sbatch queues round 1 once the job that JOB/after
/// names is over; until then it runs start.sh, which queues start.sbatch again. If 20 checks in a
/// row find nothing of the earlier job in the queue, this job fails.
std::string start_script(const schemas::FarmJobDocument& job, const std::string& job_before);
std::string queue_start_script(const schemas::FarmJobDocument& job);

/// Returns "round-N.sh", which queues a round's tasks and then the verification. Each chunk depends
/// on its instants. A second run queues nothing twice. The script writes job ids to JOB/slurm.
std::string round_script(const schemas::FarmJobDocument& job, const schemas::FarmRound& round);

/// Returns "preview.sh", which queues the preview after a round, on none of its excluded nodes.
std::string preview_script(const schemas::FarmJobDocument& job, const schemas::FarmRound& round);

/// Write the scripts of all stages, and of the round. Throw Error (failed) if the disk refuses
/// them.
void write_batch_scripts(const JobFolder& folder, const schemas::FarmJobDocument& job);
void write_round(const JobFolder& folder, const schemas::FarmJobDocument& job,
                 const schemas::FarmRound& round);

/// Returns the memory in MiB to request from Slurm: the renderer's memory budget times `factor`,
/// plus what the process needs in addition.
int slurm_megabytes(const schemas::FarmResources& resources, double factor);

}  // namespace raystage::farm
