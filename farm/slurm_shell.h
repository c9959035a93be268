// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

/// The shell functions of a job's scripts, which slurm_scripts.h puts together. They run with the
/// job folder as working directory, in any POSIX shell; every text begins with a line break.
namespace raystage::farm {

/// At its time limit, and when it is preempted, a task gets TERM and some seconds: the shell waits
/// for the command, which records what happened.
inline constexpr std::string_view kTrap = "trap : TERM\n";

/// Excludes this node for every task of the job that has not started, the verification included (so
/// the exclusion outlives Slurm's memory of the tasks), and moves this task elsewhere: requeued, it
/// is pending, and only pending tasks can be given nodes to avoid. Not where every node would be
/// left, nor where more than three and a quarter of all would be.
inline constexpr std::string_view kExcludeNode = R"sh(
usable_nodes() {  # PARTITION: prints how many
  sinfo -h -N ${1:+-p "$1"} -t idle,mix,alloc,comp -o %N | sort -u | wc -l
}
exclude_node() {
  task=${SLURM_ARRAY_JOB_ID:-$SLURM_JOB_ID}${SLURM_ARRAY_TASK_ID:+_$SLURM_ARRAY_TASK_ID}
  own=$(squeue -h -j "$task" -o %x | head -n 1)
  [ "$own" != '(null)' ] || own=
  # Without the job folder only Slurm knows how many nodes were left before; this one counts, too.
  bad=$(ls excluded 2>/dev/null | wc -l)
  given=$([ -z "$EXCLUDED" ] || scontrol show hostnames "$EXCLUDED" | wc -l)  # by the submission
  left=$(($([ -z "$own" ] || scontrol show hostnames "$own" | wc -l) + 1 - ${given:-0}))
  [ "$bad" -ge "$left" ] || bad=$left
  all=$(($(usable_nodes "$SLURM_JOB_PARTITION") - ${given:-0}))
  [ "$bad" -lt "$all" ] && { [ "$bad" -le 3 ] || [ "$bad" -le $((all / 4)) ]; } || return 0
  squeue -h --me --states=PENDING --name="$JOB_ID.prepare,$JOB_ID.render,$JOB_ID.verify,$JOB_ID.start" -o '%A %x' |
    sort -u | while read -r id nodes; do exclude_for "$id" "$nodes"; done
  trap '' TERM  # of the requeueing; KILL follows
  scontrol requeue "$task" || return 0
  nodes=$own
  for try in 1 2 3 4 5 6 7 8 9 10; do
    ! exclude_for "$task" "$nodes" || break
    sleep 0.3
  done
  sleep 3600  # Slurm ends this task now; going on would speak for the next one
}
exclude_for() {  # JOB NODES-EXCLUDED-SO-FAR
  nodes=$2
  case ",$nodes," in *",$SLURMD_NODENAME,"*) return 0 ;; esac
  [ "$nodes" != '(null)' ] || nodes=
  scontrol update JobId="$1" ExcNodeList="${nodes:+$nodes,}$SLURMD_NODENAME"
}
cd "$JOB" 2>/dev/null && [ -f job.json ] || {
  exclude_node
  echo "$SLURMD_NODENAME: the job folder is not there: $JOB" >&2
  exit 1
}
)sh";

/// sbatch passes SLURM_* variables on, whatever --export says: a task that was queued from within a
/// task would take itself for that one.
inline constexpr std::string_view kUnsetSlurmVariables = R"sh(
unset_slurm_variables() {
  for variable in $(env | sed -n 's/^\(SLURM_[A-Za-z0-9_]*\)=.*/\1/p'); do
    [ "$variable" = SLURM_CONF ] || unset "$variable"
  done
}
)sh";

/// A controller that is killed forgets what it accepted in its last seconds. Where that was the
/// verification, nothing would end the job: whichever task notices queues it anew, once a round.
inline constexpr std::string_view kRequeueVerification = R"sh(
requeue_verification() {
  [ -s "slurm/verify.$ROUND" ] && [ ! -e ended.json ] && [ ! -e cancelled ] || return 0
  known=$(squeue -h --me --name="$JOB_ID.verify" -o %i) && [ -z "$known" ] || return 0
  mkdir "slurm/lost-verify.$ROUND" 2>/dev/null || return 0
  echo 'the verification is no longer queued; it is queued anew'
  own=$(squeue -h -j "$SLURM_JOB_ID" -o %x | head -n 1)  # nodes that this task was kept from
  [ "$own" != '(null)' ] || own=
  id=$(
    unset_slurm_variables
    sbatch --parsable ${own:+--exclude="$own"} --dependency=afterany"$(cat slurm/render."$ROUND".* | sed 's/^/:/' | tr -d '\n')" \
      verify.sbatch "$ROUND" 0
  ) && echo "${id%%;*}" >"slurm/verify.$ROUND" || rmdir "slurm/lost-verify.$ROUND"
}
)sh";

/// Prints an id once sbatch has accepted a script, and keeps it. A controller that does not answer
/// is asked again for as long as PATIENCE says, seconds; one that rejects it is not.
inline constexpr std::string_view kQueue = R"sh(
is_away() {  # whether sbatch failed because nobody answered, not because the task was rejected
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
    for offset; do :; done  # the last argument: which task of the stage is array index 0
    echo "$offset" >"slurm/offset.$id"
    echo "$id" >"slurm/$name.new" && mv "slurm/$name.new" "slurm/$name"
  fi
  cat "slurm/$name"
}
)sh";

/// Ends the job where the program that should do so cannot.
inline constexpr std::string_view kFailJob = R"sh(
fail_job() {  # REASON, without quotes
  [ ! -e ended.json ] || return 0
  for stage in prepare render; do scancel --quiet --me --name="$JOB_ID.$stage"; done
  printf '{"schema": "raystage/farm_end/1", "state": "failed", "reason": "%s", "ended_utc": "%s"}\n' \
    "$1" "$(date -u +%Y-%m-%dT%H:%M:%SZ)" >ended.new && mv ended.new ended.json
}
)sh";

/// 126 and 127: the shell found no such program; 255: a container runtime could not start it.
inline constexpr std::string_view kStartFailure = R"sh(
case $code in 126 | 127 | 255)
  [ -e "excluded/$SLURMD_NODENAME" ] ||
    echo "the command of a task cannot be started (exit code $code): see logs/slurm.*.log" >"excluded/$SLURMD_NODENAME" ;;
esac
)sh";

/// Follows the command of a verification: nodes that found no job folder could say so only to
/// Slurm.
inline constexpr std::string_view kNoteExcluded = R"sh(
given=$([ -z "$EXCLUDED" ] || scontrol show hostnames "$EXCLUDED")
squeue -h -j "$SLURM_JOB_ID" -o '%x' | grep -v null | xargs -r scontrol show hostnames |
  grep -vxF "${given:--}" | while read -r node; do
    [ -e "excluded/$node" ] || echo 'the job folder is not there' >"excluded/$node"
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
exit 0  # what became of the task is in its record; a site may requeue what exits otherwise
)sh";

/// Waits in Slurm's queue, not in a process: start.sh queues this script again, later.
inline constexpr std::string_view kStart = R"sh(
exec >>logs/slurm.start.log 2>&1
[ ! -e cancelled ] || exit 0
if [ -e "$(cat after)/ended.json" ]; then
  PATIENCE=3600 sh round-1.sh || fail_job 'round 1 could not be queued: see logs/slurm.start.log'
  exit
fi
# Its verification has queued another round, or nothing of it is queued any more.
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
