#!/usr/bin/env bash
# Installs what is missing and builds everything with the release preset into build/.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
deploy/install_packages.sh --without-tests
cmake --preset release >build-configure.log 2>&1 || {
  cat build-configure.log >&2
  exit 1
}
rm -f build-configure.log
cmake --build build -- -k 0
