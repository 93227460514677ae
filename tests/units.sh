#!/usr/bin/env bash
# Checks the systemd units of deploy/systemd: that systemd understands every line of them, and that
# they give the services few rights. Usage: units.sh SOURCE_DIR BIN_DIR. Exits with 77 (skipped)
# where systemd-analyze is not installed.
set -euo pipefail
source=$1
bin=$2
command -v systemd-analyze >/dev/null || { echo "systemd-analyze is not installed"; exit 77; }

# Exposure, times ten, that is tolerated: a render node needs devices.
declare -A most=([weft-coordinator.service]=15 [weft-worker@.service]=15 [weft-render.service]=20)

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
units=()
for unit in "$source"/deploy/systemd/*.service; do
  name=$(basename "$unit")
  [ -n "${most[$name]:-}" ] || { echo "$name: no limit is set for it in tests/units.sh"; exit 1; }
  # The programs of this build in place of those that a package installs.
  sed "s#/usr/bin/#$bin/#" "$unit" >"$folder/$name"
  units+=("$folder/${name/@./@1.}")
  systemd-analyze security --offline=yes --no-pager --threshold="${most[$name]}" "$unit" \
    >"$folder/security" 2>&1 || {
    cat "$folder/security"
    echo "$name has more rights than ${most[$name]} tenths"
    exit 1
  }
  tail -n 1 "$folder/security"
  program=$(sed -n 's/^ExecStart=\([^ ]*\).*/\1/p' "$folder/$name")
  arguments=$(sed -n 's/^ExecStart=[^ ]* *//p' "$folder/$name")
  # Each option that the unit gives is one that its program has.
  for option in $(grep -o -- '--[a-z-]*' <<<"$arguments"); do
    "$program" --help | grep -q -- "$option " || { echo "$name: $program has no $option"; exit 1; }
  done
done
said=$(systemd-analyze verify --man=no "${units[@]}" 2>&1) || { echo "$said"; exit 1; }
[ -z "$said" ] || { echo "$said"; exit 1; }
