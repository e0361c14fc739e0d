# Sourced by ./limn and ./test, with $root set: installs missing packages, builds when sources changed.

say() { printf '%s\n' "limn: $*" >&2; }

# packages_of LIST...: prints the names in the lists. A line "NAME [RELEASE]" counts only on that release of Debian.
packages_of() {
  local release
  release="$(. "${OS_RELEASE:-/etc/os-release}" && printf '%s' "${VERSION_CODENAME:-}")"
  cat "$@" | sed "s/#.*//; s/\[$release\]//; /\[/d; s/[[:space:]]//g; /^$/d"
}

# install_packages LIST...
install_packages() {
  local wanted missing=() runner=()
  mapfile -t wanted < <(packages_of "$@")
  if ! command -v dpkg-query >/dev/null; then
    say "expected Debian 12 or 13 with apt, found no dpkg-query. Install the equivalents of packages.txt by hand."
    return 0
  fi
  for package in "${wanted[@]}"; do
    dpkg-query -W -f '${Status}' "$package" 2>/dev/null | grep -q '^install ok installed$' || missing+=("$package")
  done
  [ ${#missing[@]} -eq 0 ] && return 0
  if [ "$(id -u)" -ne 0 ]; then
    if ! command -v sudo >/dev/null; then
      say "these Debian packages are missing, and there is no sudo to install them. Run as root:" \
        "apt-get install --no-install-recommends --no-remove ${missing[*]}"
      return 1
    fi
    runner=(sudo)
  fi
  say "installing ${#missing[@]} Debian packages: ${missing[*]}"
  local log
  log="$(mktemp)"
  if "${runner[@]}" apt-get update -qq >"$log" 2>&1 &&
    "${runner[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -q --no-install-recommends --no-remove \
      "${missing[@]}" 2>&1 | show_steps >>"$log" && [ "${PIPESTATUS[0]}" -eq 0 ]; then
    rm -f "$log"
    return 0
  fi
  tail -n 20 "$log" >&2
  say "apt-get could not install the packages above. Complete log: $log"
  return 1
}

# Copies apt-get's output, and prints what it does every ten seconds.
show_steps() {
  local line begun=$SECONDS last=$SECONDS
  while IFS= read -r line; do
    printf '%s\n' "$line"
    if [[ $line =~ ^(Get:|Unpacking|Setting) ]] && ((SECONDS - last >= 10)); then
      last=$SECONDS
      say "installing packages ($((SECONDS - begun)) s): ${line:0:80}"
    fi
  done
}

# Copies ninja's output, and prints its progress "[12/345]" every few seconds.
show_progress() {
  local line last=0
  while IFS= read -r line; do
    printf '%s\n' "$line"
    if [[ $line =~ ^\[([0-9]+)/([0-9]+)\] ]] && ((SECONDS - last >= 5)); then
      last=$SECONDS
      say "building ${BASH_REMATCH[1]}/${BASH_REMATCH[2]} (${SECONDS} s)"
    fi
  done
}

# build TARGET: builds it, unless no source is newer than its last build.
build() {
  local target="$1" folder="$root/build/release" stamp="$root/build/release/.built-$1"
  local packages=("$root/packages.txt")
  local sources=(CMakeLists.txt CMakePresets.json packages.txt tools core scene device calib tracker projector
    shaders sim exchange wizard session remote nodes validate apps library)
  case "$target" in all | *_bench) sources+=(tests) ;; esac
  case "$target" in all) packages+=("$root/tests/packages.txt") ;; esac
  if [ -e "$stamp" ] && [ -z "$(cd "$root" && find "${sources[@]}" -newer "$stamp" -print -quit)" ]; then
    return 0
  fi
  install_packages "${packages[@]}" || return 1
  mkdir -p "$folder"
  local begun="$folder/.begun" log="$folder/build.log"
  touch "$begun"
  say "building (first time: some minutes; log: $log)"
  if (cd "$root" && cmake --preset release >"$log" 2>&1) &&
    cmake --build "$folder" --target "$target" -j "$(nproc)" 2>&1 | show_progress >>"$log" &&
    [ "${PIPESTATUS[0]}" -eq 0 ]; then
    mv "$begun" "$stamp"
    return 0
  fi
  grep -E -A 20 'error|FAILED|Error' "$log" | head -n 60 >&2
  say "the build failed. Complete log: $log"
  return 1
}
