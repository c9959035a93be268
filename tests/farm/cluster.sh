#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# Runs a real Slurm cluster on this host, for tests: munged, slurmctld and N slurmd, all listening
# on 127.0.0.1. Each node has its own PID and mount namespace. Killing it therefore ends all of its
# processes at once, and its mounts may differ from those of other nodes. Root only.
#
#   cluster.sh DIR start N [LINE...]  starts it; LINEs are added to slurm.conf. Clients need SLURM_CONF=DIR/slurm.conf
#                                     Environment: CPUS of a node (1); NODE_SHARE, per cent of a processor that all
#                                     processes of a node get together (control group cpu, version 1; none: no limit)
#   cluster.sh DIR stop               ends all of its processes
#   cluster.sh DIR kill-node NODE     simulates a power cut, and reports it to Slurm at once
#   cluster.sh DIR kill-controller | start-controller
#   cluster.sh DIR on NODE COMMAND... runs a command with the mounts of that node
#   cluster.sh DIR report             prints the queue, the nodes and what the daemons complained about
#
# DIR: at most 60 characters (UNIX socket paths), new or empty. Measured on Slurm 22.05 of Debian
# 12: a cred_expire (the time until a requeued task starts again) below 5 counts as 120.
set -u
PATH=/usr/sbin:/usr/bin:/sbin:/bin
export PATH
die() { echo "cluster.sh: $*" >&2; exit 1; }
[ $# -ge 2 ] || die "usage: cluster.sh DIR start|stop|kill-node|kill-controller|start-controller|on ..."
D=$1 VERB=$2
shift 2
[ ${#D} -le 60 ] || die "$D is too long for a socket's name"
export SLURM_CONF="$D/slurm.conf"

launch() {  # NAME COMMAND...: starts it in its own session, without the caller's descriptors
  name=$1
  shift
  setsid "$@" </dev/null >>"$D/log/$name.out" 2>&1 3>&- 4>&- 5>&- 6>&- 7>&- 8>&- 9>&- &
  echo $! >"$D/run/$name.pid"
}
await() {  # SECONDS COMMAND...: repeats it until it succeeds
  tries=$(($1 * 20))
  shift
  until "$@" >/dev/null 2>&1; do
    tries=$((tries - 1))
    [ $tries -gt 0 ] || return 1
    sleep 0.05
  done
}
finish() {  # NAME SIGNAL: sends the signal and waits for the end
  [ -s "$D/run/$1.pid" ] || return 0
  pid=$(cat "$D/run/$1.pid")
  kill -s "$2" "$pid" 2>/dev/null
  await 10 sh -c "! kill -0 $pid 2>/dev/null || grep -q '^State:.Z' /proc/$pid/status" ||
    kill -s KILL "$pid" 2>/dev/null
  rm -f "$D/run/$1.pid"
}
free_ports() {  # FIRST COUNT: succeeds if none of these local TCP ports is in use
  port=$1
  while [ $port -lt $(($1 + $2)) ]; do
    ! grep -qi "^ *[0-9]*: [0-9A-F]*$(printf ':%04X' $port) " /proc/net/tcp /proc/net/tcp6 2>/dev/null || return 1
    port=$((port + 1))
  done
}
start_controller() { launch slurmctld slurmctld -D -f "$SLURM_CONF"; await 20 scontrol ping; }
node_group() { echo "/sys/fs/cgroup/cpu/$(basename "$(dirname "$D")")-$1"; }
start_node() {
  if [ -n "${NODE_SHARE:-}" ]; then
    mkdir -p "$(node_group "$1")" && echo $((NODE_SHARE * 1000)) >"$(node_group "$1")/cpu.cfs_quota_us" ||
      die "control groups cannot be written to"
  fi
  mkdir -p "$D/spool/$1"
  # The namespace's first process reaps the others, which end with it. For tasks with --export=NONE slurmd
  # reads root's environment from a login shell, and waits for all that root's profile starts (pyenv waits up to
  # 60 s for a lock that a killed shell leaves): nodes have an empty profile.
  limit=
  [ -z "${NODE_SHARE:-}" ] || limit=$(node_group "$1")/cgroup.procs
  # shellcheck disable=SC2016
  launch "$1" sh -c '[ -z "$1" ] || echo $$ >"$1"; shift; exec "$@"' limit "$limit" \
    unshare --pid --mount --fork --kill-child --mount-proc sh -c \
    'for file in .profile .bash_profile .bash_login .bashrc; do
      [ ! -e ~root/$file ] || mount --bind /dev/null ~root/$file
    done; slurmd -D -s -f "$1" -N "$2" & wait $!' node "$SLURM_CONF" "$1"
}
# Registered nodes may still fail to run tasks; a test then fails for reasons of this host.
run_a_task_on_each() {  # N
  rm -f "$D"/run/ran.*
  i=1
  while [ $i -le "$1" ]; do
    sbatch --quiet --output=/dev/null --nodelist=n$i --wrap "touch $D/run/ran.n$i" || return 1
    i=$((i + 1))
  done
  await 60 sh -c "[ \$(ls $D/run/ran.* 2>/dev/null | wc -l) = $1 ]" && await 30 is_idle "$1"
}
report() {
  timeout 20 squeue -o '%i %j %T %r %N %M'
  timeout 20 sinfo -N -o '%N %T %E'
  grep -hiE 'error|fatal|expired|replay|not responding|fail|drain|kill' "$D"/log/*.log | tail -n 60
}
is_idle() { [ "$(sinfo -h -N -t idle -o %N | wc -l)" = "$1" ]; }

case $VERB in
start)
  N=$1
  shift
  mkdir -p "$D/run" "$D/log" "$D/state" "$D/spool" "$D/munge" || exit 1
  chmod 755 "$D" "$D/munge" "$D/log" "$D/spool"
  (umask 077; head -c 128 /dev/urandom >"$D/munge/key")
  PORT=$((16800 + $(printf %s "$D" | cksum | cut -d' ' -f1) % 200 * 50))
  until free_ports $PORT $((N + 1)); do PORT=$((PORT + 50)); done
  HOST=$(hostname -s)
  cat >"$SLURM_CONF" <<EOF
ClusterName=test
SlurmctldHost=$HOST(127.0.0.1)
SlurmctldPort=$PORT
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
CredType=cred/munge
AuthInfo=socket=$D/munge/socket,cred_expire=5
CommunicationParameters=NoCtldInAddrAny,NoInAddrAny
StateSaveLocation=$D/state
SlurmdSpoolDir=$D/spool/%n
SlurmctldPidFile=$D/run/slurmctld.slurmpid
SlurmdPidFile=$D/run/%n.slurmpid
SlurmctldLogFile=$D/log/slurmctld.log
SlurmdLogFile=$D/log/%n.log
MailProg=/bin/true
MpiDefault=none
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
PropagateResourceLimits=NONE
AccountingStorageType=accounting_storage/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU_Memory
SlurmdParameters=config_overrides
SchedulerParameters=batch_sched_delay=0,sched_interval=2,bf_interval=2
ReturnToService=2
SlurmdTimeout=30
MessageTimeout=10
TCPTimeout=2
KillWait=3
CompleteWait=0
InactiveLimit=0
NodeName=n[1-$N] NodeHostname=$HOST NodeAddr=127.0.0.1 Port=$((PORT + 1))-$((PORT + N)) CPUs=${CPUS:-1} RealMemory=4000
PartitionName=render Nodes=n[1-$N] Default=YES DefMemPerCPU=100 MaxTime=INFINITE State=UP
EOF
  for line; do echo "$line" >>"$SLURM_CONF"; done
  launch munged munged --foreground --socket="$D/munge/socket" --key-file="$D/munge/key" \
    --pid-file="$D/munge/pid" --log-file="$D/munge/log" --seed-file="$D/munge/seed" --num-threads=2
  await 10 munge -S "$D/munge/socket" -n || die "munged did not come up: $(tail -n 3 "$D/munge/log")"
  start_controller || die "slurmctld did not come up: $(tail -n 3 "$D/log/slurmctld.log")"
  i=1
  while [ $i -le "$N" ]; do
    start_node n$i
    i=$((i + 1))
  done
  await 30 is_idle "$N" || die "the nodes did not come up: $(tail -n 3 "$D"/log/n*.log)"
  run_a_task_on_each "$N" || die "the nodes run no tasks: $(report 2>&1)"
  ;;
stop)
  scontrol update partition=render state=down 2>/dev/null
  scancel --partition=render --quiet 2>/dev/null
  for pid in "$D"/run/n*.pid; do
    [ ! -e "$pid" ] || finish "$(basename "$pid" .pid)" KILL
  done
  finish slurmctld KILL
  finish munged TERM
  for pid in "$(node_group n)"*; do [ ! -d "$pid" ] || rmdir "$pid" 2>/dev/null; done
  ;;
kill-node)
  finish "$1" KILL
  scontrol update nodename="$1" state=down reason="power cut"
  ;;
kill-controller) finish slurmctld TERM ;;  # KILL within seconds of a submission would lose it
start-controller) start_controller || die "slurmctld did not come up" ;;
report) report ;;
on)
  unshared=$(cat "$D/run/$1.pid")
  shift
  exec nsenter --mount --pid --target "$(pgrep -P "$unshared" | head -n 1)" "$@"
  ;;
*) die "there is no verb $VERB" ;;
esac
