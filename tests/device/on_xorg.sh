#!/usr/bin/env bash
# on_xorg.sh PROGRAM…: runs the program on its own X server with the monitors DUMMY0 to DUMMY15 (Xorg's dummy
# driver), which xrandr can plug in and out. At the start only DUMMY0 is plugged in. The exit code is 77 when
# there is no such server.
set -u
folder="$(mktemp -d)"
cat >"$folder/xorg.conf" <<'CONF'
Section "ServerFlags"
  Option "AutoAddDevices" "false"
  Option "AutoEnableDevices" "false"
EndSection
Section "Device"
  Identifier "dummy"
  Driver "dummy"
  VideoRam 65536
EndSection
Section "Monitor"
  Identifier "monitor"
  HorizSync 5.0-1000.0
  VertRefresh 5.0-200.0
EndSection
Section "Screen"
  Identifier "screen"
  Device "dummy"
  Monitor "monitor"
  DefaultDepth 24
  SubSection "Display"
    Depth 24
    Virtual 4096 2048
  EndSubSection
EndSection
CONF
mkfifo "$folder/number"
Xorg -displayfd 3 -config "$folder/xorg.conf" -logfile "$folder/log" -noreset -nolisten tcp \
  3>"$folder/number" >"$folder/out" 2>&1 &
server=$!
read -r -t 20 number <"$folder/number"
if [ -z "${number:-}" ]; then
  cat "$folder/out" >&2
  kill "$server" 2>/dev/null
  rm -rf "$folder"
  exit 77
fi
DISPLAY=":$number" LIMN_TEST_MONITORS=several "$@"
result=$?
kill "$server"
wait "$server" 2>/dev/null
rm -rf "$folder"
exit "$result"
