# A Slurm cluster of one machine, in a folder of its own. To be sourced.
#   slurm_is_missing       prints why none can be started here; nothing if one can
#   start_slurm FOLDER     makes FOLDER, starts munged, slurmctld and slurmd there, exports SLURM_CONF and
#                          appends the processes' ids to slurm_pids; ends with 1 when one does not start
#   until_holds SECONDS WHAT COMMAND...
#   free_port              prints a port that nobody listens on
# SLURM_NODE_CPUS: the node's CPUs, also more than the machine has. Default: 2.

PATH=$PATH:/usr/sbin
slurm_pids=()

slurm_is_missing() {
  local program
  for program in slurmctld slurmd munged sbatch squeue; do
    command -v "$program" >/dev/null || { echo "$program is not installed"; return 0; }
  done
  # slurmd runs jobs as others: root of a namespace has none of these.
  if [ "$(id -u)" -ne 0 ] || ! grep -q ' 4294967295$' /proc/self/uid_map; then
    echo "slurmd runs jobs as others and wants root"
  fi
}

until_holds() {
  local seconds=$1 what=$2
  shift 2
  local end=$((SECONDS + seconds))
  while [ "$SECONDS" -lt "$end" ]; do
    if "$@" >/dev/null 2>&1; then return 0; fi
    sleep 0.2
  done
  echo "$what: not within $seconds s" >&2
  return 1
}

free_port() { python3 -c 'import socket; s = socket.socket(); s.bind(("127.0.0.1", 0)); print(s.getsockname()[1])'; }

start_slurm() {
  local folder=$1 host cpus=${SLURM_NODE_CPUS:-2}
  # Munge refuses sockets and keys that others could have written.
  mkdir -m 755 "$folder" "$folder/munge" "$folder/state" "$folder/spool"
  dd if=/dev/urandom of="$folder/munge/key" bs=1024 count=1 status=none
  chmod 400 "$folder/munge/key"
  munged --foreground --force --key-file="$folder/munge/key" --socket="$folder/munge/socket" \
    --pid-file="$folder/munge/pid" --seed-file="$folder/munge/seed" \
    --log-file="$folder/munge/munged.log" >"$folder/munged.log" 2>&1 &
  slurm_pids+=($!)
  until_holds 20 "munged listens" test -S "$folder/munge/socket"

  host=$(hostname -s)
  cat >"$folder/slurm.conf" <<CONF
ClusterName=weft
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=$(free_port)
SlurmdPort=$(free_port)
SlurmUser=root
SlurmdUser=root
SlurmdParameters=config_overrides
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
NodeName=$host NodeAddr=127.0.0.1 CPUs=$cpus State=UNKNOWN
PartitionName=all Nodes=$host Default=YES MaxTime=INFINITE State=UP
PartitionName=render Nodes=$host MaxTime=INFINITE State=UP
CONF
  export SLURM_CONF=$folder/slurm.conf
  slurmctld -D -f "$SLURM_CONF" >"$folder/slurmctld.log" 2>&1 &
  slurm_pids+=($!)
  slurmd -D -N "$host" -f "$SLURM_CONF" >"$folder/slurmd.log" 2>&1 &
  slurm_pids+=($!)
  until_holds 60 "a node is idle" sh -c 'sinfo --noheader --format=%T | grep -qx idle'
}
