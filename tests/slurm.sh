#!/usr/bin/env bash
# A Slurm cluster of one machine in a folder of its own, and `weft scale slurm` upon it: workers
# start when there is work, compute a fabric, and leave when they are idle.
#   tests/slurm.sh BIN_DIR        exits with 77 when Slurm is not installed, or when it is not root
set -euo pipefail
bin=$(cd "$1" && pwd)
source_dir=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)

for program in slurmctld slurmd munged sbatch squeue; do
  PATH=$PATH:/usr/sbin command -v "$program" >/dev/null || { echo "skipped: $program is not installed"; exit 77; }
done
[ "$(id -u)" -eq 0 ] || { echo "skipped: slurmd runs jobs as others and wants root"; exit 77; }
PATH=$PATH:/usr/sbin

folder=$(mktemp -d "${TMPDIR:-/tmp}/weft-slurm.XXXXXX")
pids=()
stop() {
  status=$?
  for pid in "${pids[@]}"; do kill -TERM "$pid" 2>/dev/null || true; done
  for pid in "${pids[@]}"; do wait "$pid" 2>/dev/null || true; done
  if [ "$status" -ne 0 ]; then
    tail -n 20 "$folder"/*.log >&2 || true
  fi
  rm -rf "$folder"
}
trap stop EXIT

until_holds() {  # SECONDS WHAT COMMAND...
  local seconds=$1 what=$2
  shift 2
  for _ in $(seq $((seconds * 5))); do
    if "$@" >/dev/null 2>&1; then return 0; fi
    sleep 0.2
  done
  echo "slurm.sh: $what: not within $seconds s" >&2
  return 1
}

free_port() { python3 -c 'import socket; s = socket.socket(); s.bind(("127.0.0.1", 0)); print(s.getsockname()[1])'; }

# Munge refuses sockets and keys that others could have written.
chmod 755 "$folder"
mkdir "$folder/munge" "$folder/state" "$folder/spool"
dd if=/dev/urandom of="$folder/munge/key" bs=1024 count=1 status=none
chmod 400 "$folder/munge/key"
munged --foreground --force --key-file="$folder/munge/key" --socket="$folder/munge/socket" \
  --pid-file="$folder/munge/pid" --seed-file="$folder/munge/seed" \
  --log-file="$folder/munge/munged.log" >"$folder/munged.log" 2>&1 &
pids+=($!)
until_holds 20 "munged listens" test -S "$folder/munge/socket"

host=$(hostname -s)
cat >"$folder/slurm.conf" <<CONF
ClusterName=weft
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=$(free_port)
SlurmdPort=$(free_port)
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket=$folder/munge/socket
CredType=cred/munge
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/spool
SlurmctldPidFile=$folder/slurmctld.pid
SlurmdPidFile=$folder/slurmd.pid
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SchedulerParameters=sched_interval=1
ReturnToService=2
MpiDefault=none
KillWait=5
MessageTimeout=60
NodeName=$host NodeAddr=127.0.0.1 CPUs=2 State=UNKNOWN
PartitionName=all Nodes=$host Default=YES MaxTime=INFINITE State=UP
CONF
export SLURM_CONF=$folder/slurm.conf
slurmctld -D -f "$SLURM_CONF" >"$folder/slurmctld.log" 2>&1 &
pids+=($!)
slurmd -D -N "$host" -f "$SLURM_CONF" >"$folder/slurmd.log" 2>&1 &
pids+=($!)
until_holds 60 "a node is idle" sh -c 'sinfo --noheader --format=%T | grep -qx idle'

port=$(free_port)
export WEFT_COORDINATOR=127.0.0.1:$port
export XDG_CACHE_HOME=$folder/cache
"$bin/weft-coordinator" --listen "$WEFT_COORDINATOR" --state "$folder/weft" >"$folder/coordinator.log" 2>&1 &
pids+=($!)
until_holds 30 "the coordinator answers" "$bin/weft" jobs

count() { squeue --noheader --array --name=weft-test --states="$1" | wc -l; }
has() { [ "$(count "$1")" -eq "$2" ]; }
at_least() { [ "$(count "$1")" -ge "$2" ]; }
workers() { "$bin/weft" workers --json | python3 -c 'import json, sys; print(" ".join(w["name"] for w in json.load(sys.stdin) if not w.get("lost")))'; }

"$bin/weft" scale slurm --max-workers 3 --threads 1 --minutes 5 --idle-seconds 4 --look-seconds 0.5 \
  --seconds-of-work 1 --job-name weft-test --output "$folder/worker-%A-%a.log" >"$folder/scale.log" 2>&1 &
scale=$!
pids+=("$scale")
sleep 2
has PENDING,RUNNING 0 || { echo "slurm.sh: workers were started though nothing waits" >&2; exit 1; }

# A job that takes a while: three workers are wanted, two of them fit on the machine.
sed 's/paths_per_cell: 512/paths_per_cell: 40000/' "$source_dir/examples/tiny.textproto" >"$folder/tiny.textproto"
"$bin/weft" submit "$folder/tiny.textproto" --wait -o "$folder/tiny.h5" >"$folder/submit.log" 2>&1 &
submit=$!
until_holds 60 "a worker runs" at_least RUNNING 1
until_holds 90 "two run and one waits" sh -c "
  [ \$(squeue --noheader --array --name=weft-test --states=RUNNING | wc -l) -eq 2 ] &&
  [ \$(squeue --noheader --array --name=weft-test --states=PENDING | wc -l) -ge 1 ]"
two_are_connected() { case $(workers) in *slurm-*slurm-*) ;; *) return 1 ;; esac; }
until_holds 60 "two workers are connected" two_are_connected

# Slurm ends one of them as at the end of its time: it leaves, and the job goes on.
one=$(squeue --noheader --array --name=weft-test --states=RUNNING --format=%i | head -n 1)
scancel --batch --signal=TERM "$one"
until_holds 40 "the worker that was told to end has left" sh -c "! squeue --noheader --array --states=RUNNING --format=%i | grep -qx '$one'"

wait "$submit"
"$bin/weft" verify "$folder/tiny.h5" >/dev/null
until_holds 60 "the workers have left" has PENDING,RUNNING,COMPLETING 0

kill -TERM "$scale"
code=0
wait "$scale" || code=$?
[ "$code" -eq 0 ] || { echo "slurm.sh: weft scale slurm ended with $code" >&2; exit 1; }
grep -q "more submitted" "$folder/scale.log"
cat "$folder/scale.log"
echo "slurm.sh: two workers of Slurm computed a fabric and left"
