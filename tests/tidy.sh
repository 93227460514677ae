#!/usr/bin/env bash
# Runs clang-tidy over the files given, or over all of ours (some twenty minutes on two cores).
# Needs a build in build/ for its compile commands.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
files=("$@")
if [ ${#files[@]} -eq 0 ]; then
  mapfile -t files < <(git ls-files '*.cpp' ':!tests' ':!bench')
fi
printf '%s\0' "${files[@]}" | xargs -0 -P "$(nproc)" -n 1 clang-tidy-14 --quiet -p build
