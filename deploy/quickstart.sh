#!/usr/bin/env bash
# From nothing installed to a picture of cloth: installs, builds, starts a coordinator and two
# workers on loopback, submits a fabric, shows progress, fetches the database into out/, renders it
# there, and says where the picture is and how long each stage took.
#
#   deploy/quickstart.sh [FABRIC.textproto]      (default: examples/silk_plain.textproto)
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

fabric=${1:-examples/silk_plain.textproto}
[ -f "$fabric" ] || { echo "quickstart: no such description: $fabric" >&2; exit 3; }
name=$(sed -n 's/^name: *"\(.*\)".*/\1/p' "$fabric" | head -n 1)
[ -n "$name" ] || { echo "quickstart: $fabric has no name: \"...\" line" >&2; exit 1; }

now() { date +%s.%N; }
took() { awk -v from="$1" -v to="$(now)" 'BEGIN { printf "%.1f s", to - from }'; }

start=$(now)
deploy/build.sh
build_time=$(took "$start")

bin=$PWD/build/bin
mkdir -p out
state=$(mktemp -d "${TMPDIR:-/tmp}/weft-quickstart.XXXXXX")
port=${WEFT_PORT:-7411}
export WEFT_COORDINATOR=127.0.0.1:$port

work=$(now)
"$bin/weft" up --workers 2 --state "$state" --listen "$WEFT_COORDINATOR" >"$state/up.log" 2>&1 &
up=$!
stop() {
  kill -TERM "$up" 2>/dev/null || true
  wait "$up" 2>/dev/null || true
  rm -rf "$state"
}
trap stop EXIT
for _ in $(seq 100); do
  "$bin/weft" workers --json >/dev/null 2>&1 && break
  kill -0 "$up" 2>/dev/null || { cat "$state/up.log" >&2; exit 5; }
  sleep 0.1
done

stage=$(now)
"$bin/weft" submit "$fabric" --quality preview --wait -o "out/$name.h5"
precompute_time=$(took "$stage")

stage=$(now)
"$bin/weft" render "out/$name.h5" -o "out/$name.exr" --png "out/$name.png"
render_time=$(took "$stage")

echo
echo "picture:     out/$name.png (and out/$name.exr)"
echo "database:    out/$name.h5"
echo "build:       $build_time"
echo "precompute:  $precompute_time"
echo "render:      $render_time"
echo "all but the build: $(took "$work")"
