#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Shows the bench on a real Slurm: starts a cluster of one node on the loopback address, runs a suite as a job array,
# kills a task in mid-run, merges, and compares with a local run of the suite, byte by byte. Everything that it starts
# runs from a temporary folder, with an authentication key of its own, and is stopped at the end.
#
#   apt-get install --no-install-recommends slurm-wlm munge         # Debian 12, Ubuntu 22.04 or newer; then, as root:
#   bench/slurm/one_node_cluster.sh [DKB_SLAM [SUITE [TASKS [LOCAL]]]]    # build/apps/dkb-slam, simulated_quick.yaml, 4
#
# LOCAL is the results folder of a local run by the same program, to be compared with; without it one is made.
#
# Works in containers: no systemd, no cgroups.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
program=$(realpath "${1:-$here/../../build/apps/dkb-slam}")
suite=$(realpath "${2:-$here/../suites/simulated_quick.yaml}")
tasks=${3:-4}
local_run=${4:+$(realpath "$4")}

fail() {
  echo "error: $*" >&2
  exit 1
}
[[ $(id -u) -eq 0 ]] || fail "run this as root: Slurm's daemons start jobs for users"
[[ -x $program ]] || fail "$program is no program; build it with \`make build\`, or name it"
for tool in munged slurmctld slurmd sbatch scontrol squeue; do
  command -v "$tool" >/dev/null || PATH=$PATH:/usr/sbin:/sbin command -v "$tool" >/dev/null ||
    fail "$tool is missing; apt-get install --no-install-recommends slurm-wlm munge"
done
PATH=$PATH:/usr/sbin:/sbin

work=$(mktemp -d /var/tmp/dkb-slurm.XXXXXX)
chmod 755 "$work"
export SLURM_CONF=$work/slurm.conf
started=()
stop() {
  scancel --quiet --full --user=root 2>/dev/null || true
  for pid_file in "${started[@]}"; do
    [[ -s $pid_file ]] && kill "$(<"$pid_file")" 2>/dev/null || true
  done
  sleep 1
  [[ -n ${KEEP:-} ]] || rm -rf "$work"
}
trap stop EXIT

echo "== munge"
mkdir -m 700 "$work/munge" && mkdir -m 755 "$work/socket"
dd if=/dev/urandom of="$work/munge/key" bs=128 count=1 status=none
chmod 400 "$work/munge/key"
munged --force --key-file="$work/munge/key" --socket="$work/socket/munge" --pid-file="$work/munge/pid" \
  --log-file="$work/munge/log" --seed-file="$work/munge/seed" --num-threads=2
started+=("$work/munge/pid")

echo "== slurm $(slurmctld -V)"
cpus=$(nproc)
((cpus >= 4)) || cpus=4 # at least two tasks at a time, also where the cores are fewer
node=$(hostname -s)
mkdir "$work/state" "$work/spool"
cat >"$SLURM_CONF" <<CONF
ClusterName=dkb
SlurmctldHost=$node(127.0.0.1)
SlurmctldPort=$((20000 + RANDOM % 10000))
SlurmdPort=$((30000 + RANDOM % 2000))
SlurmUser=root
AuthType=auth/munge
AuthInfo=socket=$work/socket/munge
StateSaveLocation=$work/state
SlurmdSpoolDir=$work/spool
SlurmctldPidFile=$work/slurmctld.pid
SlurmdPidFile=$work/slurmd.pid
SlurmctldLogFile=$work/slurmctld.log
SlurmdLogFile=$work/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
MpiDefault=none
SwitchType=switch/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SchedulerParameters=sched_interval=2
SlurmdParameters=config_overrides
ReturnToService=2
JobRequeue=1
KillWait=5
NodeName=$node NodeAddr=127.0.0.1 CPUs=$cpus State=UNKNOWN
PartitionName=bench Nodes=$node Default=YES MaxTime=INFINITE State=UP
CONF
echo "CgroupAutomount=no" >"$work/cgroup.conf"
slurmctld -f "$SLURM_CONF"
started+=("$work/slurmctld.pid")
slurmd -f "$SLURM_CONF" -N "$node"
started+=("$work/slurmd.pid")
for _ in $(seq 60); do
  sinfo -h -o %t 2>/dev/null | grep -q idle && break
  sleep 1
done
sinfo -h -o %t | grep -q idle || fail "the node does not come up; see $work/slurmd.log (KEEP=1 keeps it)"
sinfo

echo "== the suite as an array of $tasks tasks"
export DKB_SLAM=$program DKB_SUITE=$suite DKB_OUT=$work/cluster
cd "$work"
job=$(sbatch --parsable --array="1-$tasks" "$here/array.sbatch")
pending() { squeue -h -j "$job" -t all -o %T 2>/dev/null | grep -Evc 'COMPLETED|FAILED|CANCELLED|TIMEOUT' || true; }

# The first task that has finished a run but not all of them loses its bench to kill -9.
victim=
while [[ -z $victim && $(pending) -gt 0 ]]; do
  sleep 0.2
  for log in dkb-bench-"${job}"_*.log; do
    [[ -e $log ]] && grep -q '^\[[0-9]' "$log" && ! grep -q 'is complete' "$log" || continue
    task=${log##*_} task=${task%.log}
    id=$(squeue -h -r -j "${job}_$task" -t running -o %A | head -1)
    [[ -n $id ]] || continue
    for pid in $(scontrol listpids "$id" 2>/dev/null | awk '$1 ~ /^[0-9]+$/ {print $1}'); do
      if tr '\0' ' ' <"/proc/$pid/cmdline" 2>/dev/null | grep -q "^$program bench "; then
        kill -KILL "$pid" && victim=$task
        echo "killed the bench of task ${job}_$task (process $pid) after: $(grep '^\[[0-9]' "$log" | tail -1)"
        break
      fi
    done
    [[ -z $victim ]] || break
  done
done
[[ -n $victim ]] || fail "no task could be caught in mid-run; take a longer suite"

while [[ $(pending) -gt 0 ]]; do sleep 1; done
echo "-- the log of the killed task"
sed 's/^/   /' "dkb-bench-${job}_$victim.log"
echo "-- Slurm's account"
scontrol show job "${job}_$victim" | grep -E 'ArrayTaskId|JobState|Restarts' | sed 's/^/  /'
grep -q "was killed" "dkb-bench-${job}_$victim.log" || fail "the task was not put back into the queue"
for task in $(seq "$tasks"); do
  grep -q "shard $task/$tasks is complete" "dkb-bench-${job}_$task.log" || fail "task $task did not complete"
done

echo "== merge, and compare with a local run"
"$program" bench --merge "$work/cluster" --no-times
if [[ -n $local_run ]]; then # what it has is not run again
  mkdir "$work/local"
  cp -r "$local_run/suite.json" "$local_run/runs" "$local_run/truth" "$work/local/"
fi
"$program" bench "$suite" --out "$work/local" --no-times --quiet
for file in results.md results.html results.json; do
  cmp "$work/cluster/$file" "$work/local/$file" || fail "$file differs"
  echo "$file: equal, $(stat -c %s "$work/local/$file") bytes"
done
diff -r "$work/cluster/plots" "$work/local/plots" || fail "plots differ"
echo "plots: equal"
echo "done: $tasks tasks, one of them killed and requeued; the merged report equals the local one"
