#!/usr/bin/env bash
# Builds the images of deploy/Containerfile upon a fresh Debian and runs them, by the commands of
# docs/containers.md; images and containers are kept apart from this machine's, and thrown away.
#   tests/container.sh BUILD_DIR [DEBIAN.tar]     (minutes, network)
#     DEBIAN.tar   the Debian to build upon. Default: a fresh one, by mmdebstrap
# Exits with 77 (skipped) for others than root, and where buildah, podman, crun or mmdebstrap are missing.
set -euo pipefail
build=$(cd "$1" && pwd)
debian=${2:+$(realpath "$2")}
source_dir=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)

[ "$(id -u)" -eq 0 ] || { echo "skipped: only root can make a root of its own"; exit 77; }
for program in buildah podman crun mmdebstrap cpack; do
  command -v "$program" >/dev/null || { echo "skipped: $program is not installed"; exit 77; }
done
if [ "${WEFT_CONTAINER_INSIDE:-}" != 1 ]; then
  # Containers that are left over end with the namespace.
  enter=(unshare --mount --propagation private --pid --fork --kill-child --mount-proc)
  "${enter[@]}" true 2>/dev/null || { echo "skipped: nothing can be mounted here"; exit 77; }
  WEFT_CONTAINER_INSIDE=1 exec "${enter[@]}" "${BASH_SOURCE[0]}" "$build" ${debian:+"$debian"}
fi

work=$(mktemp -d "${TMPDIR:-/var/tmp}/weft-container.XXXXXX")
clean_up() {
  status=$?
  if [ "$status" -ne 0 ]; then
    tail -n 40 "$work"/*.log >&2 || true
  fi
  podman rm --all --force >/dev/null 2>&1 || true
  umount "$work/storage/overlay" 2>/dev/null || true
  umount /dev/null 2>/dev/null || true
  rm -rf "$work"
}
trap clean_up EXIT

# The engines of this machine as they are, but for where they keep things and what they may not do
# here: no network of their own, no control groups, which a machine without systemd shares out oddly.
# A container's stdin becomes its user's: so it is not this machine's /dev/null.
mknod -m 666 "$work/null" c 1 3
mount --bind "$work/null" /dev/null
umount -R /sys/fs/cgroup 2>/dev/null || true
mount -t cgroup2 none /sys/fs/cgroup
cat >"$work/storage.conf" <<CONF
[storage]
driver = "overlay"
graphroot = "$work/storage"
runroot = "$work/run"
CONF
cat >"$work/containers.conf" <<CONF
[containers]
cgroups = "disabled"
default_ulimits = ["nofile=1024:1024", "nproc=4096:4096"]
netns = "none"
[engine]
cgroup_manager = "cgroupfs"
events_logger = "file"
runtime = "crun"
tmp_dir = "$work/engine"
volume_path = "$work/volumes"
CONF
export CONTAINERS_STORAGE_CONF=$work/storage.conf CONTAINERS_CONF=$work/containers.conf BUILDAH_ISOLATION=chroot

# A checkout that was packed: cpack with less compression than it has by default.
mkdir -p "$work/tree/build" "$work/packing"
ln -s "$source_dir/deploy" "$work/tree/deploy"
(cd "$work/packing" && cpack -G DEB --config "$build/CPackConfig.cmake" \
  -D CPACK_DEBIAN_COMPRESSION_TYPE=gzip -B "$work/packing") >"$work/cpack.log" 2>&1
mv "$work"/packing/weft*.deb "$work/tree/build/"

# What would be pulled, made here.
if [ -n "$debian" ]; then
  cp "$debian" "$work/base.tar"
else
  mmdebstrap --variant=minbase bookworm "$work/base.tar" >"$work/bootstrap.log" 2>&1
fi
printf 'FROM scratch\nADD base.tar /\n' >"$work/Base"
buildah build --file "$work/Base" --tag docker.io/library/debian:bookworm-slim "$work" >"$work/base.log" 2>&1

{
  echo "set -ex; cd '$work/tree'; export HOME='$work/home' PATH='$build/bin':\$PATH"
  /usr/bin/python3 "$source_dir/tests/docs_commands.py" "$source_dir" --print docs/containers.md tests/container.sh
} >"$work/documented.sh"
timeout 900 bash "$work/documented.sh" >"$work/documented.log" 2>&1

for image in weft weft-coordinator weft-worker weft-render; do
  user=$(buildah inspect --type image --format '{{.Docker.Config.User}}' "$image")
  [ "$user" = 64711:64711 ] || { echo "$image runs as '$user'"; exit 1; }
done
for image in weft-coordinator weft-render; do
  buildah inspect --type image --format '{{.Docker.Config.Healthcheck.Test}}' "$image" | grep -q 'weft health' ||
    { echo "$image has no health check"; exit 1; }
done
# Told to end, both ended well.
for name in hub mill-1; do
  code=$(podman inspect --format '{{.State.ExitCode}}' "$name")
  [ "$code" -eq 0 ] || { echo "$name ended with $code"; podman logs "$name"; exit 1; }
done
grep -q ' is whole$' "$work/documented.log"
# A stranger is not answered by the one that listens for other machines.
if podman exec --env WEFT_TLS_FOLDER= hub.example weft health --coordinator localhost:7411; then
  echo "hub.example answered without a certificate"
  exit 1
fi
echo "images of four targets were built and run"
