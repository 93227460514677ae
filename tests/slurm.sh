#!/usr/bin/env bash
# A Slurm cluster of one machine in a folder of its own, and `weft scale slurm` upon it: workers
# start when there is work, compute a fabric, and leave when they are idle.
#   tests/slurm.sh BIN_DIR        exits with 77 when Slurm is not installed, or when it is not root
set -euo pipefail
bin=$(cd "$1" && pwd)
source_dir=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)

. "$source_dir/tests/slurm_cluster.sh"
missing=$(slurm_is_missing)
[ -z "$missing" ] || { echo "skipped: $missing"; exit 77; }

folder=$(mktemp -d "${TMPDIR:-/tmp}/weft-slurm.XXXXXX")
pids=()
stop() {
  status=$?
  for pid in "${pids[@]}"; do kill -TERM "$pid" 2>/dev/null || true; done
  for pid in "${pids[@]}"; do wait "$pid" 2>/dev/null || true; done
  if [ "$status" -ne 0 ]; then
    tail -n 20 "$folder"/*.log "$folder"/slurm/*.log >&2 || true
  fi
  rm -rf "$folder"
}
trap stop EXIT

start_slurm "$folder/slurm"
pids+=("${slurm_pids[@]}")

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
