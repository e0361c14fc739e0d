#!/usr/bin/env bash
# installed.sh CMAKE BUILD SOURCE INPUTS PYTHON OUT: installs the library and the Python package into a folder of its own,
# moves it, and runs the examples with it. Their images are left in OUT.
set -euo pipefail
cmake="$1" build="$2" source="$3" inputs="$4" python="$5" out="$6"
folder="$(mktemp -d)"
trap 'rm -rf "$folder"' EXIT
fail() { echo "$1" >&2; exit 1; }
# prints WORDS COMMAND…: runs the command and expects the words in what it prints.
prints() {
  local words="$1" text
  shift
  text="$("$@" 2>&1)" || fail "$* ended with $?: $text"
  [[ "$text" == *"$words"* ]] || fail "$*: expected '$words', found: $text"
}
# expects FILE…: that each exists and is not empty.
expects() {
  local file
  for file in "$@"; do [ -s "$file" ] || fail "$file: expected this file, found none."; done
}

for component in library python program; do
  "$cmake" --install "$build" --prefix "$folder/first" --component "$component" >"$folder/log" || fail "$(cat "$folder/log")"
done
mv "$folder/first" "$folder/prefix" # an installed tree can be moved
package="$(dirname "$(find "$folder/prefix" -path '*/limn/__init__.py')")"
PYTHONPATH="$(dirname "$package")" PATH=/usr/bin:/bin
export PYTHONPATH PATH
expects "$package/__init__.pyi"
[ -e "$package/py.typed" ] || fail "$package: expected py.typed, found none."
cd "$folder"
prints "limn " "$python" -m limn --version
libraries="$(ldd "$package"/_limn*.so | grep liblimn)"
[[ "$libraries" == *" => $folder/prefix/"* ]] || fail "_limn.so: expected liblimn.so of $folder/prefix, found $libraries"

rm -rf "$out"
mkdir -p "$out"
examples="$source/examples/python" video="$inputs/video"
prints "apriltag_36h11:1" "$python" -B "$examples/detect_and_draw.py" "$video/image0.png" apriltag_36h11 "$out/markers.png" \
  "$video/camera0.cameramodel" 80
prints "held-out" "$python" -B "$examples/calibrate.py" "$inputs/photographs" "$out/rig" charuco:8x6:40mm
prints ", 4." "$python" -B "$examples/project.py" "$inputs/rig" "$source/config/scenes/door" "$inputs/poses.json" "$out"
prints "held-out.png" "$python" -B "$examples/held_out.py" "$inputs/photographs" "$out/rig" charuco:8x6:40mm
expects "$out"/{markers,projector-projector0,projector-projector0-moved,view-camera0,rig/held-out}.png "$out/rig/report.html"
if "$python" -B "$examples/calibrate.py" "$folder/none" "$out/other" >error 2>&1; then fail "calibrate.py: expected an error without captures."; fi
if ! grep -q "$folder/none" error || grep -q Traceback error; then fail "calibrate.py: expected a message with the folder's name, found: $(cat error)"; fi
