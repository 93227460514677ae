#!/usr/bin/env bash
# Boots a fresh Debian with systemd, installs weft's packages there and runs the services of
# deploy/systemd, by the commands of docs/packages.md and docs/operator.md: a small job and a picture,
# what the units' rights are worth, certificates, signals, backup, upgrade, a reboot and removal.
#
#   services.sh BUILD_DIR [DEBIAN.tar]     (minutes, network)
#     DEBIAN.tar   what to boot, with systemd-sysv, dbus and apt's lists. Default: a fresh one, by mmdebstrap
# Exits with 77 (skipped) for others than root, and where systemd-nspawn, mmdebstrap or cpack are missing.
set -euo pipefail
build=$(cd "$1" && pwd)
debian=${2:+$(realpath "$2")}
source_dir=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)

. "$source_dir/tests/booted_debian.sh"
missing=$(boot_is_missing mmdebstrap cpack)
[ -z "$missing" ] || { echo "skipped: $missing"; exit 77; }
own_namespaces "${BASH_SOURCE[0]}" "$build" ${debian:+"$debian"}

work=$(mktemp -d)
root=$work/root
clean_up() {
  status=$?
  if [ "$status" -ne 0 ]; then
    tail -n 30 "$work"/*.log >&2 || true
    inside journalctl --no-pager --unit='weft-*' --lines=20 >&2 || true
  fi
  end_debian
  umount -R "$work" 2>/dev/null || true
  rmdir "$work" 2>/dev/null || true
}
trap clean_up EXIT
mount -t tmpfs -o mode=755 tmpfs "$work"
mkdir "$work/packages" "$root"

step() { echo "-- $SECONDS s: $*"; }
fail() { echo "$*" >&2; exit 1; }
# SECONDS COMMAND: the command succeeds within the time.
within() {
  local end=$((SECONDS + $1))
  shift
  until "$@" >/dev/null 2>&1; do
    [ "$SECONDS" -lt "$end" ] || fail "too late: $*"
    sleep 0.3
  done
}
is() { [ "$(inside systemctl show "$1" --property="$2" --value)" = "$3" ]; }
must_be() { is "$@" || fail "$1: $2 is '$(inside systemctl show "$1" --property="$2" --value)', not '$3'"; }
weft_says() { inside weft "${@:2}" | grep -q -- "$1"; }
# FOLDER --print PAGE SCRIPT [--where WHERE]: runs there what the page shows and marks for the script.
documented() {
  {
    echo "set -ex; cd $1"
    /usr/bin/python3 "$source_dir/tests/docs_commands.py" "$source_dir" "${@:2}"
  } >"$root/root/documented.sh"
  inside sh /root/documented.sh >"$work/documented.log" 2>&1 || fail "$3: its commands failed"
}

# The packages, and the same with a higher version.
make_packages() {
  local package name tree=$work/tree
  (cd "$work/packages" && cpack -G DEB --config "$build/CPackConfig.cmake" \
    -D CPACK_DEBIAN_COMPRESSION_TYPE=gzip -B "$work/packages") >"$work/cpack.log" 2>&1
  mkdir -p "$root/srv/packages" "$root/srv/newer"
  for package in "$work"/packages/*.deb; do
    cp "$package" "$root/srv/packages/"
    name=$(basename "$package")
    rm -rf "$tree"
    dpkg-deb --raw-extract "$package" "$tree"
    sed -i -e 's/^\(Version: .*-\)1$/\12/' -e 's/\bweft (= \([^)]*-\)1)/weft (= \12)/' "$tree/DEBIAN/control"
    dpkg-deb --root-owner-group -Zgzip --build "$tree" "$root/srv/newer/${name/-1_/-2_}" >/dev/null
  done
}

make_debian() {
  if [ -n "$debian" ]; then
    tar --extract --file "$debian" --directory "$root"
  else
    mmdebstrap --variant=apt --include=systemd-sysv,dbus --skip=cleanup/apt/lists bookworm "$root" \
      >"$work/bootstrap.log" 2>&1
  fi
  make_packages
  echo 'APT::Get::Assume-Yes "true";' >"$root/etc/apt/apt.conf.d/90weft-test"
  echo render-07 >"$root/etc/hostname"
  echo '127.0.0.1 localhost hub.example' >"$root/etc/hosts"
  cp /etc/resolv.conf "$root/etc/resolv.conf"
  # The machine has no network: what the packages depend on is fetched before it boots.
  chroot "$root" /usr/bin/env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin \
    sh -c 'apt-get install --download-only /srv/packages/*.deb' >"$work/download.log" 2>&1
  rm "$root/etc/resolv.conf"
}

install_packages() {
  # One certificate for all that runs here.
  HOME=$work "$build/bin/weft" certs init >/dev/null
  HOME=$work "$build/bin/weft" certs issue render-07 --host hub.example --host localhost --role admin --role worker \
    >/dev/null
  mkdir "$root/srv/packages/render-07"
  cp "$work/.config/weft/certs/render-07/"* "$root/srv/packages/render-07/"
  documented /srv/packages --print docs/packages.md tests/packages.sh
  for unit in weft-coordinator weft-worker@1 weft-render; do
    must_be "$unit" ActiveState inactive
    inside systemctl --quiet is-enabled "$unit" && fail "$unit is enabled by its installation"
  done
  inside id -nG weft | grep -q render || fail "the user weft may not draw on a GPU"
}

# All three serve, to the end of the test without having been started again.
services_run() {
  within 30 inside weft health "$@"
  within 30 inside weft health --coordinator localhost:7412 "$@"
  within 30 weft_says 'render-07/1 .* live ' workers "$@"
  for unit in weft-coordinator weft-worker@1 weft-render; do
    must_be "$unit" ActiveState active
    must_be "$unit" NRestarts 0
  done
}

# A fabric from its description to its picture; every program of weft has a part in it.
compute() {
  local name=$1
  shift
  inside sh -c "sed 's/^name: .*/name: \"$name\"/' /usr/share/doc/weft/examples/tiny.textproto >/root/$name.textproto"
  inside weft submit "/root/$name.textproto" --quality preview --wait --output "/root/$name.h5" "$@" >"$work/job.log" 2>&1
  inside weft verify "/root/$name.h5" >"$work/verify.log"
  inside weft render "$name@1" --node localhost:7412 --size 16x16 --spp 2 --output "/root/$name.exr" "$@" \
    >"$work/render.log" 2>&1
  [ -s "$root/root/$name.exr" ] || fail "there is no picture"
}

# NAME UNIT OWN_FOLDER WORD...: what a service with the unit's rights can do, of what service_rights.sh tries.
rights_are() {
  local name=$1 unit=$2 own=$3 found
  shift 3
  # The unit as it is, but for what it runs.
  inside sh -c "sed -e 's#^ExecStart=.*#ExecStart=/bin/sh /usr/anybody/service_rights.sh $own#' \
    -e 's/^Type=.*/Type=oneshot/' -e 's/^Restart=.*/Restart=no/' '/usr/lib/systemd/system/$unit' \
    >'/run/systemd/system/$name.service'"
  inside systemctl daemon-reload
  inside systemctl start "$name"
  found=$(inside journalctl --unit="$name" --output=cat --identifier=sh | tr '\n' ' ')
  [ "$found" = "$*${1:+ }" ] || fail "with the rights of $unit one can: $found; it should be: $*"
}

check_rights() {
  local all
  inside sh -c 'mkdir -p /run/systemd/system; for place in /etc /usr /var/lib /run /home; do
    mkdir -m 777 $place/anybody; done; echo 1 >/tmp/there; echo 1 >/home/anybody/there; chmod 666 /home/anybody/there
    mknod -m 666 /dev/anybody c 1 3'
  cp "$source_dir/tests/service_rights.sh" "$root/usr/anybody/"
  # Nothing is tried in vain: without a unit's rights the same user can do it all, where the kernel lets him.
  all=$(sed -n 's/^may \([a-z_]*\) .*/\1/p' "$source_dir/tests/service_rights.sh" | grep -v -x is_root)
  inside install -d -o weft /var/lib/anybody/own
  inside systemd-run --quiet --wait --pipe --uid=weft /bin/sh /usr/anybody/service_rights.sh /var/lib/anybody/own \
    >"$work/rights.log"
  diff <(grep -v makes_namespaces <<<"$all") <(grep -v makes_namespaces "$work/rights.log") ||
    fail "what is tried cannot be done without a unit's rights either"
  rights_are rights-of-coordinator weft-coordinator.service /var/lib/weft keeps_its_own
  rights_are rights-of-worker@1 weft-worker@.service /var/cache/weft/worker-1 keeps_its_own
  rights_are rights-of-render weft-render.service /var/cache/weft/fabrics keeps_its_own sees_devices maps_code
  for limit in weft-coordinator:15 weft-worker@1:15 weft-render:20; do
    inside systemd-analyze security --no-pager --threshold="${limit#*:}" "${limit%:*}.service" >"$work/security.log" ||
      fail "${limit%:*} is exposed"
    grep -o 'Overall exposure level for .*: [0-9.]*' "$work/security.log"
  done
}

# Told to end, lost, and told wrongly.
check_signals() {
  local began
  began=$SECONDS
  inside systemctl stop weft-worker@1
  [ $((SECONDS - began)) -le 12 ] || fail "a worker took $((SECONDS - began)) s to end"
  must_be weft-worker@1 Result success
  weft_says 'render-07/1 .* live ' workers && fail "a worker that has left is said to live"
  inside systemctl start weft-worker@1
  for unit in weft-coordinator weft-worker@1 weft-render; do
    inside systemctl kill --signal=KILL "$unit"
  done
  for unit in weft-coordinator weft-worker@1 weft-render; do
    within 20 is "$unit" NRestarts 1
    within 10 is "$unit" ActiveState active
    inside systemctl reset-failed "$unit"
  done
  within 30 weft_says 'render-07/1 .* live ' workers
  weft_says 'tiny .*tiny@1' jobs
  # A mistake in the configuration does not go away by itself.
  cp "$root/etc/weft/weft.toml" "$work/weft.toml"
  echo 'colour = 1' >>"$root/etc/weft/weft.toml"
  inside systemctl restart weft-worker@1 || true
  within 10 is weft-worker@1 ActiveState failed
  must_be weft-worker@1 NRestarts 0
  inside journalctl --unit=weft-worker@1 | grep -q 'there is no setting "colour"' || fail "the journal does not say why"
  cp "$work/weft.toml" "$root/etc/weft/weft.toml"
  inside systemctl restart weft-coordinator weft-worker@1 weft-render
}

between_machines() {
  /usr/bin/python3 - "$source_dir" >>"$root/etc/weft/weft.toml" <<'PYTHON'
import pathlib, sys
sys.path.insert(0, sys.argv[1] + "/tests")
import docs_blocks
name = "docs/packages.md"
blocks, _ = docs_blocks.read_page(name, (pathlib.Path(sys.argv[1]) / name).read_text())
print(next(block.text for block in blocks if block.language == "toml"))
PYTHON
  inside systemctl restart weft-coordinator weft-worker@1 weft-render
  services_run --tls-folder /srv/packages/render-07
  compute spun --tls-folder /srv/packages/render-07
  inside env WEFT_SYSTEM_CONFIG= weft jobs --coordinator localhost:7411 >"$work/refused.log" 2>&1 &&
    fail "the coordinator talks to those who show no certificate"
  grep -q 'speaks TLS' "$work/refused.log"
  cp "$work/weft.toml" "$root/etc/weft/weft.toml"
  inside systemctl restart weft-coordinator weft-worker@1 weft-render
}

upgrade() {
  local -A before
  inside systemctl stop weft-render
  for unit in weft-coordinator weft-worker@1; do
    before[$unit]=$(inside systemctl show "$unit" --property=MainPID --value)
  done
  documented /srv/newer --print docs/packages.md tests/services.sh --where 'an upgrade there'
  for unit in weft-coordinator weft-worker@1; do
    within 10 is "$unit" ActiveState active
    is "$unit" MainPID "${before[$unit]}" && fail "$unit still runs what was upgraded"
  done
  must_be weft-render ActiveState inactive
  inside dpkg-query --show --showformat='${Version}\n' weft-render | grep -q -- '-2$'
}

remove() {
  inside apt-get remove weft-worker >"$work/remove.log" 2>&1
  must_be weft-worker@1 ActiveState inactive
  inside sh -c 'apt-get install /srv/newer/weft-worker_*.deb' >>"$work/remove.log" 2>&1
  must_be weft-worker@1 ActiveState inactive
  inside apt-get purge weft weft-coordinator weft-worker weft-render >>"$work/remove.log" 2>&1
  for unit in weft-coordinator weft-worker@1 weft-render; do
    must_be "$unit" ActiveState inactive
  done
  inside sh -c 'find /etc/systemd /usr/lib/systemd /run/systemd/system -name "weft*"' | grep . && fail "units are left"
  [ -s "$root/var/lib/weft/journal.db" ] || fail "the fabrics are gone"
}

step 'a Debian'
make_debian
start_debian "$root"
step 'installed by the page'
install_packages
step 'started by the page, a job, a picture'
documented /root --print docs/packages.md tests/services.sh --where 'a Debian that it boots'
services_run
compute tiny
step 'rights'
check_rights
step 'watched, backed up and restored by the page'
documented /root --print docs/operator.md tests/services.sh
services_run
weft_says 'tiny@1' versions tiny
step 'ended, killed, told wrongly'
check_signals
step 'between machines'
between_machines
step 'upgraded'
upgrade
step 'booted again'
stop_debian
start_debian "$root"
services_run
compute twill
step 'removed'
remove
echo "weft's services run, are upgraded and removed on a Debian with systemd $(inside systemctl --version | awk 'NR == 1 { print $2 }')"
