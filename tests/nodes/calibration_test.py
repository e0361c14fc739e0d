"""Calibrates a rig whose projector is plugged into one node and whose camera into another.

    calibration_test.py LIMN ROOM_WORLD SOURCE FOLDER [--one-machine]

The projector is the screen of an X server at `left`; room_world shows what the camera at `right` sees of its light.
The rig is compared with the true one. Then the projector is nudged during a session and the rig repaired. With --one-machine all of it is at the host, without a room. Needs root.
Exit code 77: namespaces or Xvfb are not there.
"""

import json
import math
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

from machines import Machines, Network, rows_in, run, send_osc, wait_for

NODES = ["left", "right"]
PORT = 8090


def write_plan(source, folder):
    """The bench with fewer pixels, as tests/wizard/small_plan.h."""
    def read(path):
        return json.loads("\n".join(line for line in path.read_text().splitlines() if not line.strip().startswith("//")))

    world, plan = read(source / "config/worlds/bench.json"), read(source / "config/plans/bench.json")
    world["scene"] = str(source / "config/scenes/door")
    for imager, share in ((world["cameras"][0], 0.625), (world["projectors"][0], 0.25)):
        imager["size"] = [int(share * side) for side in imager["size"]]
        values = imager["lens"]["values"]
        values[:4] = [share * values[0], share * values[1],
                      share * (values[2] + 0.5) - 0.5, share * (values[3] + 0.5) - 0.5]
    plan["world"], plan["board"] = "world.json", "charuco:8x6:55mm"
    (folder / "world.json").write_text(json.dumps(world))
    (folder / "plan.json").write_text(json.dumps(plan))
    return world["cameras"][0]["size"], world["projectors"][0]["size"], len(plan["world_from_board"])


def open_screen(machines, name, size):
    """An X server in a machine; returns its display and the file of its screen."""
    place = machines.folder / f"screen-{name}"
    place.mkdir()
    reading, writing = os.pipe()
    command = ["Xvfb", "-displayfd", str(writing), "-screen", "0", f"{size[0]}x{size[1]}x24", "-fbdir", place,
               "-nocursor", "-nolisten", "tcp", "-noreset"]
    machines.programs.append(subprocess.Popen(machines.network.command(name, command), pass_fds=[writing],
                                              stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL))
    os.close(writing)
    with os.fdopen(reading) as pipe:
        return f":{pipe.readline().strip()}", place / "Xvfb_screen0"


class World:
    """room_world as a program of a machine."""

    def __init__(self, machines, name, program, plan, screen):
        command = machines.network.command(name, [program, plan, PORT, screen])
        self.program = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
                                        env=machines.environment)
        machines.programs.append(self.program)
        assert self.program.stdout.readline().startswith("did board 0"), "the world did not begin"

    def do(self, command):
        self.program.stdin.write(command + "\n")
        self.program.stdin.flush()
        answer = self.program.stdout.readline()
        assert answer == f"did {command}\n", answer


def matrix(pose):
    w, x, y, z = pose["rotation_wxyz"]
    return [[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]]


def projector_in_camera(rig):
    """The projector's centre in the camera's frame, m."""
    def centre(imager):
        pose = imager["imager_from_world"]
        turned = matrix(pose)
        return [-sum(turned[k][i] * pose["translation_m"][k] for k in range(3)) for i in range(3)]

    camera, projector = rig["cameras"][0], rig["projectors"][0]
    away = [b - a for a, b in zip(centre(camera), centre(projector))]
    return [sum(row[i] * away[i] for i in range(3)) for row in matrix(camera["imager_from_world"])]


def direction_in_camera(rig):
    """Where the projector's optical axis points, in the camera's frame."""
    d_world = matrix(rig["projectors"][0]["imager_from_world"])[2]
    return [sum(a * b for a, b in zip(row, d_world)) for row in matrix(rig["cameras"][0]["imager_from_world"])]


def degrees_apart(folder, truth):
    one, other = (direction_in_camera(json.loads((at / "rig.json").read_text())) for at in (folder, truth))
    return math.degrees(math.asin(min(1.0, math.dist(one, other) / 2)) * 2)


def report_errors(folder, truth):
    rig, true = json.loads((folder / "rig.json").read_text()), json.loads((truth / "rig.json").read_text())
    moved_mm = 1e3 * math.dist(projector_in_camera(rig), projector_in_camera(true))
    focal = {kind: abs(rig[kind][0]["lens"]["values"][0] / true[kind][0]["lens"]["values"][0] - 1)
             for kind in ("cameras", "projectors")}
    report = json.loads((folder / "report.json").read_text())
    print(f"projector's centre {moved_mm:.2f} mm from the true one; focal lengths wrong by "
          f"{1e3 * focal['cameras']:.2f} and {1e3 * focal['projectors']:.2f} permille; report {report['verdict']}")
    return moved_mm, focal, report


def calibrate(machines, source, room_world, is_one_machine):
    folder = machines.folder
    camera, projector, poses = write_plan(source, folder)
    display_at, camera_at = ("host", "host") if is_one_machine else NODES
    display, screen = open_screen(machines, display_at, projector)
    world = World(machines, camera_at, room_world, folder / "plan.json", screen)
    host = {"left": {"host": "left"}, "right": {"host": "right"}, "host": {}}
    (folder / "devices.json").write_text(json.dumps(
        {"schema": "limn.devices/1",
         "cameras": [{"name": "camera0", **host[camera_at], "source": f"http://127.0.0.1:{PORT}/", "size": camera}],
         "displays": [{"name": "projector0", **host[display_at], "monitor": "screen", "size": projector}]}))
    command = [machines.limn, "calibrate", "--devices", folder / "devices.json", "--board", "charuco:8x6:55mm",
               "--no-scan", "--terminal", "--out", folder / "rig"]
    if is_one_machine:
        command = ["env", f"DISPLAY={display}", *command]
    else:
        machines.start("left", ["env", f"DISPLAY={display}", machines.limn, "node", "--join", "studio", "--name", "left",
                                "--out", folder / "left-0"], 100)
        machines.start_node("right", clock_ahead_s=200)
        wait_for(20, lambda: "waits for a host" in (folder / "left.log").read_text(), "the node begins")
        wait_for(20, lambda: "waits for a host" in (folder / "right.log").read_text(), "the node begins")
        time.sleep(1)
        command += ["--room", "studio", "--name", "host"]
    begun = time.monotonic()
    program = subprocess.Popen(machines.network.command("host", command), stdout=subprocess.PIPE, text=True,
                               stderr=subprocess.STDOUT, env=machines.environment)
    machines.programs.append(program)
    watchdog = threading.Timer(400, program.kill)
    watchdog.start()
    lines, held = [], 0
    for line in program.stdout:
        lines.append(line)
        print(f"{time.monotonic() - begun:6.1f} s  {line}", end="", flush=True)
        if re.search(r": hold the board", line):
            world.do(f"board {held % poses}")
            held += 1
    watchdog.cancel()
    assert program.wait() == 0, "the calibration failed:\n" + "".join(lines[-20:])
    moved_mm, focal, report = report_errors(folder / "rig", folder / "truth")
    assert moved_mm < 1.5 and max(focal.values()) < 1.5e-3, "the rig is not the true one"
    assert report["verdict"] == "good" and report["held_out"]["rms_px"] < 0.1, report["held_out"]
    return world


def repair(machines, source, world):
    """A projector at a node is nudged during a session; the host's repair finds how."""
    folder = machines.folder
    world.do("prototype")
    host = machines.start("host", [machines.limn, "live", "--room", "studio", "--name", "host", "--devices",
                                   folder / "devices.json", "--rig", folder / "rig", "--scene",
                                   source / "config/scenes/door", "--osc", "9000", "--out", folder / "live"])
    log, images = folder / "host.log", folder / "left-0/shown.csv"
    wait_for(60, lambda: rows_in(images) > 30, "the node shows images")
    world.do("board 5")  # one camera and one projector can be told apart by it only
    world.do("nudge projector0 0 0.4 0")
    before = degrees_apart(folder / "rig", folder / "truth")
    begun = time.monotonic()
    send_osc(machines, "host", "/limn/repair")
    wait_for(150, lambda: "live: repair:" in log.read_text(), "the repair ends")
    seconds = time.monotonic() - begun
    rows = rows_in(images)
    wait_for(20, lambda: rows_in(images) > rows + 20, "the node shows images again")
    host.send_signal(signal.SIGTERM)
    assert host.wait(20) == 0, "the host failed"
    sentence = next(line for line in log.read_text().splitlines() if "live: repair:" in line)
    print(sentence)
    after = degrees_apart(folder / "live/repaired-1", folder / "truth")
    print(f"the projector's axis was {before:.3f} degrees from the true one before the repair, {after:.3f} after it, "
          f"in {seconds:.0f} s")
    strangers = [name for name in NODES if "other keys" in (folder / f"{name}.log").read_text()]
    assert not strangers, f"{strangers}: took a host that had left for a stranger"
    assert "projector0" in sentence and before > 0.3 and after < 0.1, sentence


def main():
    limn, room_world, source, folder = (Path(word).resolve() for word in sys.argv[1:5])
    if os.geteuid() != 0 or not shutil.which("Xvfb") or run("ip", "netns", "add", "limn-probe", check=False).returncode:
        print("skipped: network namespaces need root, and screens Xvfb")
        return 77
    run("ip", "netns", "del", "limn-probe", check=False)
    subprocess.run(["rm", "-rf", folder], check=True)
    folder.mkdir(parents=True)
    network = Network(["host", *NODES])
    machines = Machines(limn, folder, network)
    try:
        subprocess.run([limn, "room", "create", "studio"], check=True, env=machines.environment, capture_output=True)
        is_one_machine = "--one-machine" in sys.argv
        world = calibrate(machines, source, room_world, is_one_machine)
        if not is_one_machine:
            repair(machines, source, world)
    finally:
        for program in machines.programs:
            program.kill()
        network.close()
    return 0


if __name__ == "__main__":
    sys.exit(main())
