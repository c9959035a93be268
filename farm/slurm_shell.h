// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

/// The shell functions of a job's scripts, which slurm_scripts.cpp joins. They run in any POSIX
/// shell with the job folder as working directory. Every text begins with a line break.
namespace raystage::farm {

/// A task gets TERM some seconds before it is killed at its time limit or preempted. The shell
/// survives TERM and waits for the command, which records what happened.
inline constexpr std::string_view kTrap = "trap : TERM\n";

/// Excludes this node for all pending tasks of the job, including the verification, so that the
/// exclusion outlives Slurm's memory of the tasks. Then requeues this task, because Slurm can
/// exclude nodes only for pending tasks. Does nothing if no node would remain, or if more than
/// three nodes and more than a quarter of all would be excluded.
inline constexpr std::string_view kExcludeNode = R"sh(
usable_nodes() {  # PARTITION: prints the number of its usable nodes
  sinfo -h -N ${1:+-p "$1"} -t idle,mix,alloc,comp -o %N | sort -u | wc -l
}
exclude_node() {
  task=${SLURM_ARRAY_JOB_ID:-$SLURM_JOB_ID}${SLURM_ARRAY_TASK_ID:+_$SLURM_ARRAY_TASK_ID}
  own=$(squeue -h -j "$task" -o %x | head -n 1)
  [ "$own" != '(null)' ] || own=
  # Without the job folder only Slurm knows the number of excluded nodes; this node counts, too.
  bad=$(ls excluded 2>/dev/null | wc -l)
  given=$([ -z "$EXCLUDED" ] || scontrol show hostnames "$EXCLUDED" | wc -l)  # by the submission
  left=$(($([ -z "$own" ] || scontrol show hostnames "$own" | wc -l) + 1 - ${given:-0}))
  [ "$bad" -ge "$left" ] || bad=$left
  all=$(($(usable_nodes "$SLURM_JOB_PARTITION") - ${given:-0}))
  [ "$bad" -lt "$all" ] && { [ "$bad" -le 3 ] || [ "$bad" -le $((all / 4)) ]; } || return 0
  squeue -h --me --states=PENDING --name="$JOB_ID.prepare,$JOB_ID.render,$JOB_ID.verify,$JOB_ID.start" -o '%A %x' |
    sort -u | while read -r id nodes; do exclude_for "$id" "$nodes"; done
  trap '' TERM  # requeueing sends TERM, then KILL
  scontrol requeue "$task" || return 0
  nodes=$own
  for try in 1 2 3 4 5 6 7 8 9 10; do
    ! exclude_for "$task" "$nodes" || break
    sleep 0.3
  done
  sleep 3600  # Slurm ends this task now; further commands would act for the requeued one
}
exclude_for() {  # JOB NODES-EXCLUDED-SO-FAR
  nodes=$2
  case ",$nodes," in *",$SLURMD_NODENAME,"*) return 0 ;; esac
  [ "$nodes" != '(null)' ] || nodes=
  scontrol update JobId="$1" ExcNodeList="${nodes:+$nodes,}$SLURMD_NODENAME"
}
cd "$JOB" 2>/dev/null && [ -f job.json ] || {
  exclude_node
  echo "$SLURMD_NODENAME: the job folder does not exist: $JOB" >&2
  exit 1
}
)sh";

/// sbatch passes SLURM_* variables on in spite of --export: a task that another task queued would
/// have the variables of that task.
inline constexpr std::string_view kUnsetSlurmVariables = R"sh(
unset_slurm_variables() {
  for variable in $(env | sed -n 's/^\(SLURM_[A-Za-z0-9_]*\)=.*/\1/p'); do
    [ "$variable" = SLURM_CONF ] || unset "$variable"
  done
}
)sh";

/// A killed controller forgets the tasks that it accepted in its last seconds. If the verification
/// is lost, nothing ends the job: the first task that notices queues it again, once per round.
inline constexpr std::string_view kRequeueVerification = R"sh(
requeue_verification() {
  [ -s "slurm/verify.$ROUND" ] && [ ! -e ended.json ] && [ ! -e cancelled ] || return 0
  known=$(squeue -h --me --name="$JOB_ID.verify" -o %i) && [ -z "$known" ] || return 0
  mkdir "slurm/lost-verify.$ROUND" 2>/dev/null || return 0
  echo 'the verification is no longer queued; queueing it again'
  own=$(squeue -h -j "$SLURM_JOB_ID" -o %x | head -n 1)  # nodes that this task excludes
  [ "$own" != '(null)' ] || own=
  id=$(
    unset_slurm_variables
    sbatch --parsable ${own:+--exclude="$own"} --dependency=afterany"$(cat slurm/render."$ROUND".* | sed 's/^/:/' | tr -d '\n')" \
      verify.sbatch "$ROUND" 0
  ) && echo "${id%%;*}" >"slurm/verify.$ROUND" || rmdir "slurm/lost-verify.$ROUND"
}
)sh";

/// Submits a script once, stores its id in JOB/slurm and prints it. Tries again for PATIENCE
/// seconds if the controller does not answer, but not if it rejects the script.
inline constexpr std::string_view kQueue = R"sh(
is_away() {  # whether sbatch failed without an answer, not because the task was rejected
  grep -qiE 'contact|connect|timed out|temporarily|transmi|communicat' slurm/said
}
queue() {  # NAME SBATCH-ARGUMENT... SCRIPT ROUND OFFSET
  name=$1
  shift
  if [ ! -s "slurm/$name" ]; then
    waited=0
    until id=$(sbatch --parsable "$@" 2>"slurm/said"); do
      cat slurm/said >&2
      [ "$waited" -lt "${PATIENCE:-0}" ] && is_away || return 1
      sleep 10
      waited=$((waited + 10))
    done
    id=${id%%;*}
    for offset; do :; done  # the last argument: index of the task that is array index 0
    echo "$offset" >"slurm/offset.$id"
    echo "$id" >"slurm/$name.new" && mv "slurm/$name.new" "slurm/$name"
  fi
  cat "slurm/$name"
}
)sh";

/// Ends the job as failed if the program that should end it cannot run.
inline constexpr std::string_view kFailJob = R"sh(
fail_job() {  # REASON, without quotes
  [ ! -e ended.json ] || return 0
  for stage in prepare render; do scancel --quiet --me --name="$JOB_ID.$stage"; done
  printf '{"schema": "raystage/farm_end/1", "state": "failed", "reason": "%s", "ended_utc": "%s"}\n' \
    "$1" "$(date -u +%Y-%m-%dT%H:%M:%SZ)" >ended.new && mv ended.new ended.json
}
)sh";

/// 126 and 127: the shell could not start the program; 255: a container runtime could not.
inline constexpr std::string_view kStartFailure = R"sh(
case $code in 126 | 127 | 255)
  [ -e "excluded/$SLURMD_NODENAME" ] ||
    echo "the command of a task cannot be started (exit code $code): see logs/slurm.*.log" >"excluded/$SLURMD_NODENAME" ;;
esac
)sh";

/// Records nodes that are excluded only in Slurm's queue: those without the job folder.
inline constexpr std::string_view kNoteExcluded = R"sh(
given=$([ -z "$EXCLUDED" ] || scontrol show hostnames "$EXCLUDED")
squeue -h -j "$SLURM_JOB_ID" -o '%x' | grep -v null | xargs -r scontrol show hostnames |
  grep -vxF "${given:--}" | while read -r node; do
    [ -e "excluded/$node" ] || echo 'the job folder does not exist on this node' >"excluded/$node"
  done
)sh";
inline constexpr std::string_view kAfterVerification = R"sh(
next=after-verify-$ROUND.sh
if [ -f "$next" ]; then
  PATIENCE=3600 sh "$next" || fail_job 'the next round could not be queued: see logs/slurm.verify.0.log'
elif [ ! -e ended.json ] && [ "$code" -ne 143 ] && [ "$code" -ne 130 ]; then
  [ ! -e "excluded/$SLURMD_NODENAME" ] || exclude_node
  fail_job "the verification ended with exit code $code: see logs/slurm.verify.0.log"
fi
exit 0  # the result is in the task's record; a site may requeue tasks with other exit codes
)sh";

/// Waits in Slurm's queue, not in a process: start.sh queues this script again with a delay.
inline constexpr std::string_view kStart = R"sh(
exec >>logs/slurm.start.log 2>&1
[ ! -e cancelled ] || exit 0
if [ -e "$(cat after)/ended.json" ]; then
  PATIENCE=3600 sh round-1.sh || fail_job 'round 1 could not be queued: see logs/slurm.start.log'
  exit
fi
# The earlier job is in another round, or nothing of it is queued any more.
idle=${1:-0}
known=$(squeue -h --me --name="$BEFORE.prepare,$BEFORE.render,$BEFORE.verify,$BEFORE.start" -o %i) &&
  [ -z "$known" ] && idle=$((idle + 1)) || idle=0
if [ "$idle" -ge 20 ]; then
  fail_job 'the job that it waited for is stalled: retry or cancel that one, then retry this one'
  exit
fi
PATIENCE=3600 sh start.sh 15 "$idle" || fail_job 'the start could not be queued: see logs/slurm.start.log'
)sh";

inline constexpr std::string_view kQueueStart = R"sh(
is_away() { grep -qiE 'contact|connect|timed out|temporarily|transmi|communicat' slurm/said; }
unset_slurm_variables
newest=$(ls -v "$(cat after)"/slurm/start "$(cat after)"/slurm/verify.* 2>/dev/null |
  grep -v '[.]new$' | tail -n 1)
waited=0
until id=$(sbatch --parsable ${newest:+--dependency=afterany:$(cat "$newest")} \
  --begin=now+"${1:-0}" start.sbatch "${2:-0}" 2>slurm/said); do
  cat slurm/said >&2
  [ "$waited" -lt "${PATIENCE:-0}" ] && is_away || exit 1
  sleep 10
  waited=$((waited + 10))
done
printf '%s\n' "${id%%;*}" >slurm/start.new && mv slurm/start.new slurm/start
)sh";

}  // namespace raystage::farm
