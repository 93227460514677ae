#!/usr/bin/env bash
# Builds the Debian packages of a build, installs them with dpkg into a clean root, runs a small job
# there with the installed programs alone, and removes them again.
#
#   packages.sh BUILD_DIR               the root is this machine's, under a layer that is thrown away
#   packages.sh BUILD_DIR --bootstrap   the root is a fresh Debian, by mmdebstrap (minutes, network)
#
# The packages are installed and set up there by the commands of docs/packages.md. Exits with 77 (skipped) for others than root, and where nothing can be mounted.
set -euo pipefail
build=$(cd "$1" && pwd)
source_dir=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
way=${2:-layer}

[ "$(id -u)" -eq 0 ] || { echo "only root can install packages"; exit 77; }
if [ "${WEFT_PACKAGES_INSIDE:-}" != 1 ]; then
  enter=(unshare --mount --propagation private)
  "${enter[@]}" true 2>/dev/null || { echo "nothing can be mounted here"; exit 77; }
  WEFT_PACKAGES_INSIDE=1 exec "${enter[@]}" "${BASH_SOURCE[0]}" "$build" "$way"
fi

work=$(mktemp -d)
clean_up() {
  umount -R "$work/root" 2>/dev/null || true
  umount "$work" 2>/dev/null || true
  rmdir "$work" 2>/dev/null || true
}
trap clean_up EXIT
mount -t tmpfs -o mode=755 tmpfs "$work" || { echo "nothing can be mounted here"; exit 77; }
mkdir "$work/packages" "$work/root"

# Small: the time goes into compressing.
(cd "$work/packages" && cpack -G DEB --config "$build/CPackConfig.cmake" \
  -D CPACK_DEBIAN_COMPRESSION_TYPE=gzip -B "$work/packages") >"$work/cpack.log" 2>&1 || {
  cat "$work/cpack.log"
  exit 1
}
mapfile -t packages < <(ls "$work"/packages/*.deb)
[ "${#packages[@]}" -eq 4 ] || { printf '%s\n' "${packages[@]}"; echo "four were expected"; exit 1; }
for package in "${packages[@]}"; do
  dpkg-deb --field "$package" Depends | grep -q 'libc6 (>=' || {
    echo "$package does not say which libraries it needs"
    exit 1
  }
done

if [ "$way" = --bootstrap ]; then
  # Everything that is mentioned as a dependency is fetched, and nothing else.
  mmdebstrap --variant=apt --skip=cleanup/apt/lists bookworm "$work/root" >"$work/bootstrap.log" 2>&1 || {
    tail "$work/bootstrap.log"
    exit 1
  }
else
  mkdir "$work/upper" "$work/workdir"
  mount -t overlay overlay -o "lowerdir=/,upperdir=$work/upper,workdir=$work/workdir" "$work/root" ||
    { echo "no layer can be laid over this machine's files"; exit 77; }
fi
root=$work/root
mount --rbind /dev "$root/dev"
# As the units mount it: nothing of the machine in it but the caller's processes.
mount -t proc -o subset=pid proc "$root/proc" 2>/dev/null || mount --rbind /proc "$root/proc"
mount -t tmpfs -o mode=1777 tmpfs "$root/tmp"
cp "${packages[@]}" "$root/tmp/"
if [ "$way" = --bootstrap ]; then
  cp /etc/resolv.conf "$root/etc/resolv.conf"
fi
inside() { chroot "$root" /usr/bin/env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/tmp/home "$@"; }
if [ "$way" != --bootstrap ]; then
  # The build must not help: where it was there is nothing.
  mount -t tmpfs tmpfs "$root$build"
fi

# A reader says yes, and has a certificate of his machine.
echo 'APT::Get::Assume-Yes "true";' >"$root/etc/apt/apt.conf.d/90weft-test"
mkdir "$root/tmp/render-07"
touch "$root/tmp/render-07/cert.pem" "$root/tmp/render-07/key.pem" "$root/tmp/render-07/ca.pem"
{
  echo 'set -ex; cd /tmp; export DEBIAN_FRONTEND=noninteractive'
  /usr/bin/python3 "$source_dir/tests/docs_commands.py" "$source_dir" --print docs/packages.md tests/packages.sh
} >"$root/tmp/documented.sh"
inside sh /tmp/documented.sh >"$work/install.log" 2>&1 || { tail -n 40 "$work/install.log"; exit 1; }
[ "$(inside stat --format=%U:%a /etc/weft/tls/key.pem)" = weft:600 ] || { echo "a key is not the user's"; exit 1; }
rm -r "$root/etc/weft/tls"

cat >"$root/tmp/job.sh" <<'JOB'
set -eu
mkdir -p /tmp/home && cd /tmp/home
id weft >/dev/null
weft --version
test -s /usr/share/man/man1/weft-submit.1.gz
test -s /usr/share/man/man8/weft-worker.8.gz
test -s /usr/share/bash-completion/completions/weft
test -s /usr/share/zsh/vendor-completions/_weft
test -s /usr/share/fish/vendor_completions.d/weft.fish
test -s /etc/weft/weft.toml
test -s /usr/lib/python3/dist-packages/weft/weft.protoset
if /usr/bin/python3 -c 'import grpc, h5py' 2>/dev/null; then
  /usr/bin/python3 -c 'import weft; print(weft.expand("/usr/share/doc/weft/examples/tiny.textproto").name)' | grep -qx tiny
fi
for program in weft weft-open weft-coordinator weft-worker weft-render; do
  test "$(command -v $program)" = /usr/bin/$program
done
for unit in weft-coordinator weft-worker@ weft-render; do
  test -s /usr/lib/systemd/system/$unit.service
done
# The machine's file is read: it says where the coordinator is, and where it listens.
cat >>/etc/weft/weft.toml <<'TOML'
coordinator = "unix:/tmp/home/hub"
[weft-coordinator]
listen = "unix:/tmp/home/hub"
TOML
weft config show | grep -q '^coordinator .*system file (/etc/weft/weft.toml'
weft-coordinator --state state >coordinator.log 2>&1 &
coordinator=$!
weft-worker --threads 2 --scratch scratch >worker.log 2>&1 &
worker=$!
for _ in $(seq 100); do weft jobs >/dev/null 2>&1 && break; sleep 0.1; done
weft submit /usr/share/doc/weft/examples/tiny.textproto --quality preview --wait -o tiny.h5 ||
  { cat coordinator.log worker.log; exit 1; }
weft verify tiny.h5
weft render tiny.h5 --device cpu --size 32x32 --spp 4 -o tiny.exr
kill -TERM $worker && wait $worker
kill -TERM $coordinator && wait $coordinator
test -s tiny.exr
JOB
inside sh /tmp/job.sh >"$work/job.log" 2>&1 || {
  cat "$work/job.log"
  exit 1
}

inside dpkg --purge weft-coordinator weft-worker weft-render weft >"$work/purge.log" 2>&1 || {
  cat "$work/purge.log"
  exit 1
}
left=$(inside sh -c 'ls -d /etc/weft /usr/bin/weft* /usr/lib/systemd/system/weft* \
  /usr/lib/sysusers.d/weft* /usr/share/man/man?/weft* /usr/share/doc/weft* 2>/dev/null' || true)
[ -z "$left" ] || { echo "left after the purge: $left"; exit 1; }
echo "packages: ${packages[*]##*/}"
