#!/usr/bin/env bash
# installed.sh CMAKE BUILD SOURCE INPUTS COMPILER: installs the library into a folder of its own, builds the examples against
# it with find_package and one with pkg-config, and runs them.
set -euo pipefail
cmake="$1" build="$2" source="$3" inputs="$4" compiler="$5"
folder="$(mktemp -d)"
trap 'rm -rf "$folder"' EXIT
fail() { echo "$1" >&2; exit 1; }
# expects FILE…: that each exists and is not empty.
expects() {
  local file
  for file in "$@"; do [ -s "$file" ] || fail "$file: expected this file, found none."; done
}
# prints WORDS COMMAND…: runs the command and expects the words in what it prints.
prints() {
  local words="$1" text
  shift
  text="$("$@" 2>&1)" || fail "$* ended with $?: $text"
  [[ "$text" == *"$words"* ]] || fail "$*: expected '$words', found: $text"
}

for component in library development; do
  "$cmake" --install "$build" --prefix "$folder/first" --component "$component" >"$folder/log" || fail "$(cat "$folder/log")"
done
mv "$folder/first" "$folder/prefix" # an installed tree can be moved

library="$(find "$folder/prefix" -name 'liblimn.so.0')"
expects "$library"
foreign="$(nm -D --defined-only "$library" | awk '{print $3}' | grep -vE '^_Z[A-Z]*4limn4v[0-9]_[0-9]|^LIMN_[0-9.]+(@|$)' || true)"
[ -z "$foreign" ] || fail "liblimn.so: expected only names of limn::v0_… to be exported, found: $(head -5 <<<"$foreign")"
[ "$(nm -DC --defined-only "$library" | grep -c 'T limn::v0_')" -gt 80 ] || fail "liblimn.so: exports too little"
devices="$(readelf -d "$library" | grep -oE 'lib(glfw|aravis|opencv_videoio|opencv_imgcodecs|cairo|boost|ssl|X11)[^]]*' || true)"
[ -z "$devices" ] || fail "liblimn.so: expected no libraries of devices, windows and exporters, found: $devices"

"$cmake" -S "$source/examples" -B "$folder/build" -DCMAKE_PREFIX_PATH="$folder/prefix" -DCMAKE_CXX_COMPILER="$compiler" \
  -DCMAKE_BUILD_TYPE=Debug >"$folder/log" 2>&1 || fail "$(cat "$folder/log")"
"$cmake" --build "$folder/build" >"$folder/log" 2>&1 || fail "$(cat "$folder/log")"
! grep -q warning "$folder/log" || fail "$(cat "$folder/log")"

video="$inputs/video"
cd "$folder"
prints "apriltag_36h11:1" build/detect "$video/image0.png" apriltag_36h11 "$video/camera0.cameramodel" 80
prints "standard deviation in depth" build/detect "$video/image0.png" apriltag_36h11 "$video/camera0.cameramodel" 80
prints "by 2 markers" build/track "$video/camera0.cameramodel" "$video/body.json" 30 "$video"/image?.png
prints "back within" build/camera_files "$video/camera0.cameramodel" "$folder/camera"
expects camera.cameramodel camera.yml camera_ros.yaml
prints "held-out" build/calibrate "$inputs/photographs" rig charuco:8x6:40mm
expects rig/report.html rig/rig.json
prints ", 4." build/project "$inputs/rig" "$source/config/scenes/door" "$inputs/poses.json" images
expects images/projector-projector0.png images/composite-camera0.png
if build/detect "$folder/none.png" apriltag_36h11 2>error; then fail "detect: expected an error without an image."; fi
grep -q none.png error || fail "detect: expected the file's name, found: $(cat error)"

pc="$(dirname "$(find prefix -name limn.pc)")"
# shellcheck disable=SC2046 # several words
"$compiler" "$source/examples/detect.cpp" -o by_pkg_config \
  $(PKG_CONFIG_PATH="$pc" pkg-config --cflags --libs limn) -Wl,-rpath,"$folder/$(dirname "$pc")"
prints "apriltag_36h11:0" ./by_pkg_config "$video/image0.png" apriltag_36h11
