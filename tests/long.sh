#!/usr/bin/env bash
# The tests that take long: tests/long.sh [SEEDS [FIRST_SEED [FUZZ_SECONDS]]]
# Simulated clusters (default: 10000 seeds from 1001 on), real processes that are killed again and
# again and every flip of a byte (WEFT_LONG=1), packages, services and containers in a fresh Debian (mmdebstrap),
# manifests in an API server of Kubernetes, and fuzzing (default: 600 s for each target; 0: none).
# Wants a built tree (tests/run.sh --build-only). Prints the time that each part took.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

seeds=${1:-10000}
first=${2:-1001}
fuzz_seconds=${3:-600}
for number in "$seeds" "$first" "$fuzz_seconds"; do
  if ! [[ $number =~ ^[0-9]+$ ]]; then
    sed -n '2,6s/^# //p' "$0" >&2
    exit 2
  fi
done

failed=()
part() {
  local name=$1 began=$SECONDS
  shift
  echo "== $name: $*"
  "$@" || { [ $? -eq 77 ] && echo "== $name: skipped"; } || failed+=("$name")
  echo "== $name: $((SECONDS - began)) s"
}

# As many programs as there are cores share the seeds.
simulate() {
  local jobs share from pids=() status=0
  jobs=$(nproc)
  share=$(((seeds + jobs - 1) / jobs))
  for ((from = first; from < first + seeds; from += share)); do
    local left=$((first + seeds - from))
    build/bin/test_simulation --first "$from" --seeds $((left < share ? left : share)) &
    pids+=($!)
  done
  for pid in "${pids[@]}"; do
    wait "$pid" || status=1
  done
  return "$status"
}

part simulation simulate
export WEFT_LONG=1
part real_processes_and_flips ctest --test-dir build --output-on-failure -R 'Faults|Flips' --timeout 14400
if command -v mmdebstrap >/dev/null; then
  part packages_in_a_fresh_debian tests/packages.sh build --bootstrap
else
  echo "== packages_in_a_fresh_debian: skipped, mmdebstrap is not installed"
fi
has_all() { for program in "$@"; do command -v "$program" >/dev/null || return 1; done; }
if has_all mmdebstrap systemd-nspawn; then
  part services tests/services.sh build
else
  echo "== services: skipped, not all of mmdebstrap and systemd-nspawn are installed"
fi
if has_all buildah podman crun mmdebstrap; then
  part containers tests/container.sh build
else
  echo "== containers: skipped, not all of buildah, podman, crun and mmdebstrap are installed"
fi
part kubernetes tests/kubernetes_apiserver.sh build
if [ "$fuzz_seconds" -gt 0 ]; then
  part fuzzing fuzz/run.sh "$fuzz_seconds"
fi
if [ ${#failed[@]} -gt 0 ]; then
  echo "failed: ${failed[*]}" >&2
  exit 1
fi
