#!/usr/bin/env bash
# on_systemd.sh PROGRAM…: runs the program beside systemd's manager of user services and a journal, both its own: in
# new namespaces for processes and mounts, in a control group of their own, with HOME in a new folder. The exit code is
# 77 when there is no systemd here, or no right to do this.
set -u
skip() { echo "no systemd: $1" >&2 && exit 77; }

if [ "${1:-}" != --inside ]; then
  for program in systemctl journalctl unshare /usr/lib/systemd/systemd /usr/lib/systemd/systemd-journald; do
    command -v "$program" >/dev/null || skip "expected the program $program, found none"
  done
  [ "$(id -u)" -eq 0 ] || skip "only root may make control groups"
  [ -s /etc/machine-id ] || skip "expected a machine's number in /etc/machine-id, found none"
  # The mounts below end with this program.
  unshare --mount true 2>/dev/null || skip "no right to mount"
  [ -n "${LIMN_TEST_OWN_MOUNTS:-}" ] || LIMN_TEST_OWN_MOUNTS=yes exec unshare --mount "$0" "$@"
  clean_up() {
    find "${group:-/nowhere}" -depth -type d -exec rmdir {} + 2>/dev/null
    umount "$folder/groups" 2>/dev/null
    rm -rf --one-file-system "$folder"
  }
  trap clean_up EXIT
  trap 'exit 130' INT TERM
  folder="$(mktemp -d)" && mkdir -m 700 "$folder/home" "$folder/groups"
  # Version 2 of the control groups, wherever this machine has them.
  mount -t cgroup2 none "$folder/groups" 2>/dev/null || skip "no control groups"
  group="$folder/groups/limn-test-$$" service=user.slice/user-0.slice/user@0.service
  result=77
  if mkdir -p "$group/$service" 2>/dev/null; then
    # The journal takes processes in a group of this name for a user's services.
    (echo "$BASHPID" >"$group/cgroup.procs" && LIMN_TEST_FOLDER="$folder" LIMN_TEST_GROUP="$service" exec unshare --mount \
      --cgroup --pid --fork --kill-child --mount-proc "$0" --inside "$@")
    result=$?
  fi
  [ $result -ne 77 ] || skip "the manager could not be started"
  exit $result
fi

shift
mount --make-rprivate / && mount -t tmpfs none /run && mkdir -p /run/systemd/system /run/systemd/journald.conf.d || exit 77
if mountpoint -q /sys/fs/cgroup; then umount -R /sys/fs/cgroup; fi
mount -t cgroup2 none /sys/fs/cgroup || exit 77
mkdir -m 700 /run/user /run/user/0
export HOME="$LIMN_TEST_FOLDER/home" XDG_RUNTIME_DIR=/run/user/0 XDG_CONFIG_HOME="$LIMN_TEST_FOLDER/home/.config"
export LIMN_TEST_SYSTEMD=yes
printf '[Journal]\nStorage=volatile\nRuntimeMaxUse=16M\nReadKMsg=no\nAudit=no\n' >/run/systemd/journald.conf.d/limn.conf
/usr/lib/systemd/systemd-journald &
for _ in $(seq 100); do if [ -S /run/systemd/journal/stdout ]; then break; fi; sleep 0.05; done
(echo "$BASHPID" >"/sys/fs/cgroup/$LIMN_TEST_GROUP/cgroup.procs" &&
  exec /usr/lib/systemd/systemd --user --unit=basic.target >"$LIMN_TEST_FOLDER/manager" 2>&1) &
manager=$!
for _ in $(seq 100); do
  if systemctl --user is-system-running >/dev/null 2>&1; then
    "$@"
    result=$?
    kill -RTMIN+24 $manager && wait $manager  # it ends its services
    exit $result
  fi
  sleep 0.05
done
cat "$LIMN_TEST_FOLDER/manager" >&2
exit 77
