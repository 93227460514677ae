#!/usr/bin/env bash
# Installs, builds and runs every test. --build-only stops after the build.
# Tests that want published drafts, yarns and meshes look in $WEFT_SHARED_DATA (default:
# ../shared/data beside the checkout) and skip with a message when it is absent.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

build_only=0
for argument in "$@"; do
  case "$argument" in
    --build-only) build_only=1 ;;
    -h | --help) sed -n '2,4s/^# //p' "$0"; exit 0 ;;
    *) echo "tests/run.sh: unknown argument '$argument'; it takes --build-only" >&2; exit 2 ;;
  esac
done

[ "$build_only" -eq 1 ] || deploy/install_packages.sh
deploy/build.sh
[ "$build_only" -eq 0 ] || exit 0

if [ -z "${WEFT_SHARED_DATA:-}" ] && [ -d ../shared/data ]; then
  WEFT_SHARED_DATA=$(cd ../shared/data && pwd)
  export WEFT_SHARED_DATA
fi
ctest --test-dir build --output-on-failure -j "$(nproc)"
