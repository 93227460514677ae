#!/usr/bin/env bash
# Fails when a C++ file is not as .clang-format wants it, or is longer than the house allows.
set -euo pipefail
cd "$1"
mapfile -t files < <(git ls-files '*.cpp' '*.h')
clang-format-14 --dry-run --Werror "${files[@]}"
status=0
for file in "${files[@]}"; do
  lines=$(wc -l <"$file")
  if [ "$lines" -gt 500 ]; then
    echo "$file: $lines lines: past 500 a file holds two ideas" >&2
    status=1
  fi
done
exit $status
