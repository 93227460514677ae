# shellcheck shell=bash
# A fresh Debian with systemd as its first process, in namespaces of its own; for scripts that source
# it: boot_is_missing, own_namespaces, start_debian, inside, stop_debian.
#
#   . tests/booted_debian.sh
#   own_namespaces "$0" "$@"      # goes on as root of a mount and a PID namespace
#   start_debian ROOT             # a folder with Debian, systemd-sysv and dbus; no network but loopback
#   inside COMMAND...             # as root of that machine
#   stop_debian                   # as if its button were pressed

# Why no machine can be booted here; nothing if one can.
boot_is_missing() {
  [ "$(id -u)" -eq 0 ] || { echo "only root can boot a machine of its own"; return; }
  local program
  for program in "$@" systemd-nspawn unshare nsenter; do
    command -v "$program" >/dev/null || { echo "$program is not installed"; return; }
  done
  unshare --mount --propagation private --pid --fork --kill-child --mount-proc true 2>/dev/null ||
    echo "nothing can be mounted here"
}

own_namespaces() {
  [ "${WEFT_BOOT_INSIDE:-}" != 1 ] || return 0
  # What is left over ends with the namespace.
  WEFT_BOOT_INSIDE=1 exec unshare --mount --propagation private --pid --fork --kill-child --mount-proc "$@"
}

# Whatever shares out this machine's control groups, systemd there gets a branch of its own.
own_control_groups() {
  umount -R /sys/fs/cgroup 2>/dev/null || true
  mount -t cgroup2 none /sys/fs/cgroup
  booted_groups=/sys/fs/cgroup/weft-boot.$(tr -d - </proc/sys/kernel/random/uuid)
  mkdir "$booted_groups"
}

start_debian() {
  local root=$1 end
  [ -n "${booted_groups:-}" ] || own_control_groups
  # It is told apart from the machine around it, and keeps nothing there.
  mount -t tmpfs tmpfs /run
  # shellcheck disable=SC2016
  SYSTEMD_NSPAWN_UNIFIED_HIERARCHY=1 sh -c 'echo $$ >"$1/cgroup.procs"; shift; exec "$@"' - "$booted_groups" \
    systemd-nspawn --quiet --boot --register=no --keep-unit --machine=weft --private-network \
    --resolv-conf=off --timezone=off --console=pipe --directory="$root" </dev/null >>"$root.console" 2>&1 &
  booted_by=$!
  end=$((SECONDS + 60))
  while [ "$SECONDS" -lt "$end" ]; do
    booted=$(pgrep --parent "$booted_by" --exact systemd || true)
    if [ -n "$booted" ] && [ -S "/proc/$booted/root/run/systemd/private" ]; then
      inside systemctl is-system-running --wait >/dev/null || inside systemctl --no-pager --failed
      return
    fi
    kill -0 "$booted_by" 2>/dev/null || break
    sleep 0.2
  done
  echo "the machine does not boot:"
  tail -n 20 "$root.console"
  return 1
}

inside() {
  nsenter --target "$booted" --all /usr/bin/env -i HOME=/root USER=root LANG=C.UTF-8 \
    DEBIAN_FRONTEND=noninteractive PATH=/usr/sbin:/usr/bin:/sbin:/bin "$@"
}

stop_debian() {
  inside systemctl poweroff
  wait "$booted_by" || true
  umount /run
}

# For whoever cleans up, after whatever happened.
end_debian() {
  local tries
  if [ -n "${booted_by:-}" ]; then
    kill -KILL "$booted_by" ${booted:+"$booted"} 2>/dev/null || true
    wait "$booted_by" 2>/dev/null || true
  fi
  [ -n "${booted_groups:-}" ] || return 0
  # Its processes end a moment after the first of them.
  for ((tries = 0; tries < 50; ++tries)); do
    find "$booted_groups" -depth -type d -exec rmdir {} + 2>/dev/null || true
    [ -d "$booted_groups" ] || return 0
    sleep 0.1
  done
}
