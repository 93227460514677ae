#!/usr/bin/env bash
# Runs the fuzz targets with libFuzzer: fuzz/run.sh SECONDS [TARGET...], all of them when none is
# named, for SECONDS each and JOBS (default 1) at a time. Builds them first (preset fuzz, clang-14).
# What is learnt stays in build-fuzz/corpus, findings go to build-fuzz/findings; fuzz/corpus is only
# read. Prints one line for each target; exits with 1 when there was a finding.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

if [ $# -lt 1 ] || ! [[ $1 =~ ^[1-9][0-9]*$ ]]; then
  sed -n '2,5s/^# //p' "$0" >&2
  exit 2
fi
seconds=$1
shift
targets=("$@")
[ ${#targets[@]} -gt 0 ] || mapfile -t targets < <(cd fuzz && printf '%s\n' ./*_fuzz.cpp | sed 's|./||; s|_fuzz.cpp||')
command -v clang++-14 >/dev/null || {
  echo "fuzz/run.sh: clang++-14 with libFuzzer is needed: apt-get install clang-14" >&2
  exit 1
}
cmake --preset fuzz >build-fuzz-configure.log 2>&1 || {
  cat build-fuzz-configure.log >&2
  exit 1
}
rm -f build-fuzz-configure.log
cmake --build build-fuzz --target "${targets[@]/#/fuzz_}" -- --quiet

run() {
  local target=$1 corpus=build-fuzz/corpus/$1 findings=build-fuzz/findings/$1 log=build-fuzz/$1.log
  mkdir -p "$corpus" "$findings"
  local status=0
  nice "build-fuzz/bin/fuzz_$target" "$corpus" "fuzz/corpus/$target" \
    -max_total_time="$seconds" -timeout=25 -rss_limit_mb=4096 -print_final_stats=1 \
    -artifact_prefix="$findings/" 2>&1 | grep -av 'libprotobuf ERROR' >"$log" || status=$?
  local executions coverage contained
  executions=$(sed -n 's/^stat::number_of_executed_units: *//p' "$log")
  coverage=$(grep -oE 'cov: [0-9]+' "$log" | tail -1 | cut -d' ' -f2)
  contained=$(sed -n 's/^apart: //p' "$log" | tail -1)
  echo "$target: ${executions:-?} executions, ${coverage:-?} edges$([ "$status" -eq 0 ] || echo ", FINDING (status $status): $log, $findings")${contained:+; $contained}"
  return "$status"
}

failed=0
for target in "${targets[@]}"; do
  while [ "$(jobs -rp | wc -l)" -ge "${JOBS:-1}" ]; do
    wait -n || failed=1
  done
  run "$target" &
done
for job in $(jobs -p); do
  wait "$job" || failed=1
done
exit $failed
