#!/usr/bin/env bash
# Installs what weft is built from and tested with: the Debian 12 packages in deploy/packages.txt.
# --without-tests leaves out what tests alone need (browsers, Blender, Slurm, ...).
# Does nothing, and needs no rights, when all of them are there.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)

last='$'
for argument in "$@"; do
  case "$argument" in
    --without-tests) last='/^# ---- tests:/' ;;
    -h | --help) sed -n '2,4s/^# //p' "$0"; exit 0 ;;
    *) echo "install_packages.sh: unknown argument '$argument'; it takes --without-tests" >&2; exit 2 ;;
  esac
done
mapfile -t packages < <(sed -n "1,${last}p" "$here/packages.txt" | grep -vE '^\s*(#|$)')

missing=()
for package in "${packages[@]}"; do
  status=$(dpkg-query -W -f='${db:Status-Status}' "$package" 2>/dev/null || true)
  [ "$status" = installed ] || missing+=("$package")
done
[ ${#missing[@]} -gt 0 ] || exit 0

as_root=()
if [ "$(id -u)" -ne 0 ]; then
  command -v sudo >/dev/null || {
    echo "these packages are missing; install them as root: apt-get install ${missing[*]}" >&2
    exit 1
  }
  as_root=(sudo)
fi
echo "installing ${#missing[@]} packages: ${missing[*]}" >&2
"${as_root[@]}" apt-get update -qq
"${as_root[@]}" env DEBIAN_FRONTEND=noninteractive \
  apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null
