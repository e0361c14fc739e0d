# Sourced by tools/on_debian and tools/check_packages, after tools/build.sh: roots of Debian's releases.

# The release of this machine, such as bookworm.
own_release() { . "${OS_RELEASE:-/etc/os-release}" && printf '%s' "${VERSION_CODENAME:-}"; }

# The mirror of this machine's own Debian sources, in either format of apt's files.
mirror() {
  [ -n "${LIMN_DEBIAN_MIRROR:-}" ] && printf '%s\n' "$LIMN_DEBIAN_MIRROR" && return
  apt-get indextargets --format '$(RELEASE) $(REPO_URI)' 'Created-By: Packages' 2>/dev/null |
    awk -v suite="$(own_release)" '$1 == suite && $2 ~ /\/debian\/?$/ { print $2; exit }'
}

# Runs a command as the root user of new namespaces, in which a folder of another system can be mounted and entered.
apart() {
  local users=()
  [ "$(id -u)" -eq 0 ] || users=(--map-root-user --map-auto)
  unshare "${users[@]}" --mount --pid --fork --kill-child "$@"
}

# make_root FOLDER RELEASE: a root with the packages that every Debian has, and the sources of the release.
make_root() {
  local from options mode=root
  from="$(mirror)"
  if [ -z "$from" ]; then
    say "expected a Debian mirror in this machine's apt sources, found none. Set LIMN_DEBIAN_MIRROR to its address."
    return 1
  fi
  if ! command -v mmdebstrap >/dev/null; then
    say "mmdebstrap is missing. Run as root: apt-get install mmdebstrap uidmap"
    return 1
  fi
  [ "$(id -u)" -eq 0 ] || mode=unshare
  say "making a root of Debian $2 from $from"
  # The root's apt reaches the mirror as this machine's does (proxy, certificates, checks of dates).
  mapfile -t options < <(apt-config dump | grep -E '^Acquire::(https?|Check-)' | sed 's/^/--aptopt=/')
  # The archive is unpacked in the namespace of `enter`: that of mmdebstrap has other numbers of users.
  apart rm -rf "$1.new" && mkdir -p "$1.new" &&
    mmdebstrap --quiet --variant=minbase --mode="$mode" "${options[@]}" "$2" - \
      "deb $from $2 main" "deb $from $2-updates main" |
    apart tar -xf - -C "$1.new" --numeric-owner --exclude='./dev/*' &&
    [ "${PIPESTATUS[0]}" -eq 0 ] && mv "$1.new" "$1" && return 0
  say "mmdebstrap could not make the root; its messages are above."
  return 1
}

# enter FOLDER USER COMMAND ...: runs the command in the root, with this machine's network and devices, in the home of
# the user with this number. The folder becomes the root of a mount namespace, not of a chroot: only so may the command
# make namespaces of its own (Chromium, tests of networks).
enter() {
  apart bash -c '
    folder="$1" user="$2"; shift 2
    cp /etc/resolv.conf /etc/hosts "$folder/etc/" && mount --bind "$folder" "$folder" && cd "$folder" &&
      mount -t proc proc proc && mount --rbind /sys sys && mount --rbind /dev dev && mount -t tmpfs tmpfs tmp &&
      pivot_root . . && umount --lazy . && cd / || exit 1
    home="$(getent passwd "$user" | cut -d : -f 6)"
    exec setpriv --reuid="$user" --regid="$user" --clear-groups /usr/bin/env -i \
      PATH=/usr/local/bin:/usr/bin:/usr/sbin:/bin:/sbin HOME="$home" USER="$(id -nu "$user")" LANG=C.UTF-8 \
      TERM="${TERM:-dumb}" DEBIAN_FRONTEND=noninteractive bash -c "cd && exec \"\$@\"" bash "$@"
  ' bash "$@"
}
