#!/bin/sh
# Tries what a service of weft should not be able to do, and prints a word for each that it can:
#   service_rights.sh OWN_FOLDER
# tests/services.sh makes what it tries to reach, and runs it with and without a unit's rights.
own=$1
may() {
  what=$1
  shift
  if "$@" >/dev/null 2>&1; then echo "$what"; fi
}
writes() { echo 1 >"$1"; }
status() { sed -n "s/^$1:[[:space:]]*//p" /proc/self/status; }
# mmap of memory that can be written and run; a socket of AF_NETLINK.
maps_code() { perl -e 'exit(syscall(9, 0, 4096, 7, 0x22, -1, 0) == -1)'; }
opens_netlink() { perl -e 'exit(!socket(my $s, 16, 3, 0))'; }
makes_setuid() { echo 1 >"$own/setuid" && chmod u+s "$own/setuid" && test -u "$own/setuid"; }

may keeps_its_own writes "$own/kept"
may writes_etc writes /etc/anybody/written
may writes_usr writes /usr/anybody/written
may writes_var writes /var/lib/anybody/written
may writes_run writes /run/anybody/written
may sees_homes cat /home/anybody/there
may sees_files_in_tmp cat /tmp/there
may sees_devices ls /dev/anybody
may sees_processes ls -d /proc/1
may maps_code maps_code
may opens_netlink opens_netlink
may makes_setuid makes_setuid
may makes_namespaces unshare --user true
may has_capabilities_within_reach test "$(status CapBnd)" != 0000000000000000
may gains_rights test "$(status NoNewPrivs)" != 1
may calls_for_resources perl -e 'exit(!setpriority(0, 0, 15))'
may is_root test "$(id -u)" -eq 0
rm -f "$own/kept" "$own/setuid"
