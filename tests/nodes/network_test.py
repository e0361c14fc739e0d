"""Runs a host and its nodes as programs in network and time namespaces of one machine, and breaks things.

    network_test.py LIMN CLOCK_LIBRARY FOLDER [--repeat N] [SCENARIO ...]

Without a name all scenarios run but those of BY_NAME. With --repeat each runs N times, and those that give numbers
print a table of them. Needs root.
Exit code 77: namespaces are not permitted here.
"""

import argparse
import bisect
import csv
import json
import os
import subprocess
import sys
import time
import traceback
from pathlib import Path

import failures
from machines import (NODES, PREFIX, LossyNetwork, Machines, Network, NetworkOfVersion6, NetworkWithoutMulticast,
                      fingerprints, prepare, rows_in, run, send_osc, shown, wait_for)


def placement_mm(poses, path, slot="mirror"):
    """How far the light of a part is from where the host says that it belongs at each moment, RMS: at a node, and at an
    ideal one, which shows every frame at its moment. An image stays until the next one. All on the host's clock."""
    with open(poses) as file:
        belongs = [(float(row["shown_at_s"]), [float(row[axis]) for axis in ("x_mm", "y_mm", "z_mm")])
                   for row in csv.DictReader(file) if row["slot"] == slot]
    times = [at for at, _ in belongs]

    def place(at_s):
        after = min(max(bisect.bisect_left(times, at_s), 1), len(times) - 1)
        (t0, p0), (t1, p1) = belongs[after - 1], belongs[after]
        share = (at_s - t0) / (t1 - t0)
        return [a + share * (b - a) for a, b in zip(p0, p1)]

    def rms(lights, begin_s, end_s):
        squares = []
        for (from_s, drawn), (until_s, _) in zip(lights, lights[1:]):
            for step in range(int((min(until_s, end_s) - max(from_s, begin_s)) / 0.002)):
                there = place(max(from_s, begin_s) + 0.002 * step)
                squares.append(sum((a - b) ** 2 for a, b in zip(there, drawn)))
        return (sum(squares) / len(squares)) ** 0.5

    at_node = [(int(row["shown_at_ns"]) / 1e9, place(int(row["wanted_at_ns"]) / 1e9)) for row in shown(path)[10:]]
    limits = at_node[0][0], at_node[-1][0]
    return rms(at_node, *limits), rms(belongs, *limits)


def show_images(machines, count):
    """Runs host and nodes until each node has shown more than `count` images; returns the nodes' shown.csv."""
    for node in NODES:
        machines.start_node(node)
    host = machines.start_host(0)
    paths = [machines.folder / f"{node}-0/shown.csv" for node in NODES]
    wait_for(90, lambda: all(rows_in(path) > count for path in paths), "the nodes show images")
    machines.end()
    assert host.returncode == 0, "the host failed"
    return paths


def images_are_the_hosts(machines):
    """Every image that a node shows is the host's, and nearly all frames arrive."""
    paths = show_images(machines, 60)
    wanted = fingerprints(machines.folder / "host/frames.csv")
    for node, path in zip(NODES, paths):
        rows = shown(path)
        wrong = [row["frame"] for row in rows if wanted[row["frame"], row["projector"]] != row["fingerprint"]]
        assert not wrong, f"{node}: {len(wrong)} of {len(rows)} images differ from the host's: {wrong[:5]}"
        late_ms = sorted(abs(int(row["shown_at_ns"]) - int(row["wanted_at_ns"])) / 1e6 for row in rows[10:])
        print(f"{node}: {len(rows)} images equal; from the wanted moment: median {late_ms[len(late_ms) // 2]:.2f} ms, "
              f"99 % {late_ms[int(0.99 * len(late_ms))]:.2f} ms")


def a_screen_at_a_node_shows_images(machines):
    """One node has a screen, too, and no image of a projector differs or is missing by it."""
    path = machines.folder / "devices.json"
    devices = json.loads(path.read_text())
    devices["displays"].append({"name": "screen0", "host": "left", "monitor": "offscreen", "size": [1280, 720]})
    path.unlink()  # it is a link to the file of all scenarios
    path.write_text(json.dumps(devices))
    images_are_the_hosts(machines)
    log = (machines.folder / "left.log").read_text()
    assert "screen0 shows the host's images" in log and "screen0:" not in log, log


def nobody_freezes_on_a_bad_network(machines):
    """1 % of all packets are lost, and each is delayed by up to 20 ms."""
    paths = show_images(machines, 60)
    wanted = fingerprints(machines.folder / "host/frames.csv")
    for node, path in zip(NODES, paths):
        rows = shown(path)
        assert all(wanted[row["frame"], row["projector"]] == row["fingerprint"] for row in rows)
        at_s = [int(row["shown_at_ns"]) / 1e9 for row in rows[5:]]
        pauses = [after - before for before, after in zip(at_s, at_s[1:])]
        described = int(rows[-1]["frame"]) - int(rows[5]["frame"])
        print(f"{node}: {len(rows) - 6} of {described} frames shown, the longest pause {max(pauses):.2f} s")
        assert len(rows) - 6 > 0.5 * described and max(pauses) < 1.5, (len(rows), described, max(pauses))


nobody_freezes_on_a_bad_network.network = LossyNetwork


def placement_on_a_network(machines):
    """A part that sways by 50 mm in a second; on this network and on one that delays and loses packets."""
    paths = show_images(machines, 150)
    numbers = {}
    for node, path in zip(NODES, paths):
        at_node_mm, ideal_mm = placement_mm(machines.folder / "host/poses.csv", path)
        numbers[f"placement at {node}, RMS, mm"] = at_node_mm
        numbers[f"of an ideal node, of {node}'s time, RMS, mm"] = ideal_mm
        numbers[f"ratio of {node}"] = at_node_mm / ideal_mm
    return numbers


def placement_on_a_bad_network(machines):
    return placement_on_a_network(machines)


placement_on_a_bad_network.network = LossyNetwork
placement_on_a_network.swaying = placement_on_a_bad_network.swaying = "aruco_4x4_50:0"


def meet(machines, extra=()):
    for node in NODES:
        machines.start_node(node, extra=extra)
    machines.start_host(0)
    paths = [machines.folder / f"{node}-0/shown.csv" for node in NODES]
    seconds = wait_for(60, lambda: all(rows_in(path) > 5 for path in paths), "the nodes show images")
    print(f"images {seconds:.1f} s after the start")
    machines.end()


def machines_meet_without_multicast(machines):
    """With the host's address as a peer of the nodes."""
    meet(machines, ["--peer", f"{PREFIX}1"])


def machines_meet_by_ipv6(machines):
    meet(machines)


machines_meet_without_multicast.network = NetworkWithoutMulticast
machines_meet_by_ipv6.network = NetworkOfVersion6


def a_blackout_reaches_all_and_one_recording_replays_the_room(machines):
    """Black within 100 ms at all nodes; the host's recording replays on one machine, to the bit."""
    for node in NODES:
        machines.start_node(node)
    recording = machines.folder / "of-the-room"
    host = machines.start_host(0, extra=["--osc", "9000", "--record", recording])
    paths = [machines.folder / f"{node}-0/shown.csv" for node in NODES]
    wait_for(60, lambda: all(rows_in(path) > 60 for path in paths), "the nodes show images")
    sent_ns = send_osc(machines, "host", "/limn/blackout", "on")
    time.sleep(1.5)
    machines.end()
    assert host.returncode == 0, "the host failed"
    black_s = {}
    for node, path in zip(NODES, paths):
        rows = shown(path)
        black = rows[-1]["fingerprint"]
        first = next(row for row in rows if row["fingerprint"] == black)
        assert all(row["fingerprint"] == black for row in rows[rows.index(first):]) and rows.index(first) > 50
        black_s[f"black at {node} after, s"] = (int(first["shown_at_ns"]) - sent_ns) / 1e9
    replayed = subprocess.run([machines.limn, "replay", recording], env=machines.environment, capture_output=True,
                              text=True)
    assert replayed.returncode == 0 and "identical to the recorded ones" in replayed.stderr, replayed.stderr
    equal = failures.compared(machines, paths)
    assert max(black_s.values()) < 0.3, black_s
    return {**black_s, **equal}


def twenty_blackouts(machines):
    """Blackout on and off, 20 times in one session: until both nodes are black."""
    for node in NODES:
        machines.start_node(node)
    host = machines.start_host(0, extra=["--osc", "9000"])
    paths = [machines.folder / f"{node}-0/shown.csv" for node in NODES]
    wait_for(60, lambda: all(rows_in(path) > 60 for path in paths), "the nodes show images")
    sent = []
    for number in range(20):
        sent.append(send_osc(machines, "host", "/limn/blackout", "on"))
        time.sleep(0.5)
        send_osc(machines, "host", "/limn/blackout", "off")
        time.sleep(0.5 + 0.013 * number)  # at another moment of a frame each time
    send_osc(machines, "host", "/limn/blackout", "on")
    time.sleep(1)
    machines.end()
    assert host.returncode == 0, "the host failed"
    black_s = []
    for path in paths:
        rows = shown(path)
        black = rows[-1]["fingerprint"]
        at = [int(row["shown_at_ns"]) for row in rows if row["fingerprint"] == black]
        black_s.append([(min(at_ns for at_ns in at if at_ns > sent_ns) - sent_ns) / 1e9 for sent_ns in sent])
    both_s = sorted(max(pair) for pair in zip(*black_s))
    return {"both nodes black, median of 20, s": both_s[10], "worst, s": both_s[-1]}


def a_thousand_frames_of_three_nodes(machines):
    """Three nodes with four projectors, whose clocks are 100 s apart and drift by 50 ppm against each other."""
    nodes = machines.nodes
    for number, (node, drift) in enumerate(zip(nodes, (50e-6, -50e-6, 0)), 1):
        machines.set_clock(node, drift)
        machines.start_node(node, clock_ahead_s=100 * number)
    host = machines.start_host(0)
    paths = {node: machines.folder / f"{node}-0/shown.csv" for node in nodes}

    def frames(path):
        return len({row["frame"] for row in shown(path)}) if path.exists() else 0

    wait_for(280, lambda: all(frames(path) >= 1000 for path in paths.values()), "1000 frames at each node", 2)
    machines.end()
    assert host.returncode == 0, "the host failed"
    numbers = failures.compared(machines, paths.values())
    at_ms = {}
    for node, path in paths.items():
        rows = shown(path)[20:]
        late_ms = sorted(abs(int(row["shown_at_ns"]) - int(row["wanted_at_ns"])) / 1e6 for row in rows)
        numbers[f"{node}: light from the wanted moment, median, ms"] = late_ms[len(late_ms) // 2]
        numbers[f"{node}: likewise, 99 %, ms"] = late_ms[int(0.99 * len(late_ms))]
        for row in rows:
            at_ms.setdefault(row["frame"], {})[node] = int(row["shown_at_ns"]) / 1e6
    skews = sorted(max(at.values()) - min(at.values()) for at in at_ms.values() if len(at) == len(nodes))
    numbers["skew of the three nodes, median, ms"] = skews[len(skews) // 2]
    return numbers


a_thousand_frames_of_three_nodes.world = "quarters"
a_thousand_frames_of_three_nodes.nodes = ["left", "right", "top"]


def a_second_host_is_refused(machines):
    machines.start_host(12)
    time.sleep(4)
    (machines.folder / "second.json").write_text((machines.folder / "devices.json").read_text())  # of its own machine
    second = machines.start("left", [machines.limn, "live", "--room", "studio", "--name", "second", "--devices",
                                     machines.folder / "second.json", "--rig", machines.folder / "recording/rig",
                                     "--scene", machines.folder / "recording/scene", "--seconds", "1"])
    assert second.wait(20) == 1
    assert "expected no host in it, found host" in (machines.folder / "left.log").read_text()
    machines.end()


SCENARIOS = [images_are_the_hosts, nobody_freezes_on_a_bad_network, machines_meet_without_multicast,
             machines_meet_by_ipv6, *failures.SCENARIOS,
             a_blackout_reaches_all_and_one_recording_replays_the_room, a_second_host_is_refused]

BY_NAME = [twenty_blackouts, a_thousand_frames_of_three_nodes, placement_on_a_network, placement_on_a_bad_network,
           a_screen_at_a_node_shows_images, failures.a_node_sleeps,
           failures.a_large_scene_comes_while_frames_run]  # long ones


def run_once(scenario, run_number, arguments):
    """Runs a scenario in a new network; returns its numbers, if it has some."""
    place = arguments.folder.resolve() / scenario.__name__
    subprocess.run(["rm", "-rf", place], check=True)
    place.mkdir(parents=True)
    nodes, world = getattr(scenario, "nodes", NODES), getattr(scenario, "world", "studio")
    swaying = getattr(scenario, "swaying", None)
    prepared = arguments.folder.resolve() / f"prepared-{world}{'-swaying' if swaying else ''}"
    if not prepared.exists():
        prepared.mkdir()
        prepare(arguments.limn.resolve(), prepared, world, nodes, swaying)
    for path in prepared.iterdir():
        (place / path.name).symlink_to(path)
    network = getattr(scenario, "network", Network)(["host", *nodes])
    machines = Machines(arguments.limn.resolve(), place, network, arguments.clock_library.resolve())
    machines.run_number, machines.nodes = run_number, nodes
    try:
        return scenario(machines)
    finally:
        for program in machines.programs:
            program.kill()
        network.close()


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("limn", type=Path)
    parser.add_argument("clock_library", type=Path)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--repeat", type=int, default=1)
    parser.add_argument("scenarios", nargs="*")
    arguments = parser.parse_intermixed_args()
    if os.geteuid() != 0 or run("ip", "netns", "add", "limn-probe", check=False).returncode != 0:
        print("skipped: network namespaces need root")
        return 77
    run("ip", "netns", "del", "limn-probe", check=False)
    subprocess.run(["rm", "-rf", *arguments.folder.glob("prepared-*")], check=True)
    known = {scenario.__name__: scenario for scenario in SCENARIOS + BY_NAME}
    failed = 0
    for name in arguments.scenarios or [scenario.__name__ for scenario in SCENARIOS]:
        runs = []
        for number in range(arguments.repeat):
            begun, load = time.monotonic(), os.getloadavg()[0]
            try:
                runs.append(run_once(known[name], number, arguments))
                print(f"{name}: passed in {time.monotonic() - begun:.0f} s, load {load:.1f}: {runs[-1] or ''}",
                      flush=True)
            except AssertionError as problem:
                failed += 1
                print(f"{name}: failed: {problem}", flush=True)
            except Exception:  # the other scenarios still run
                failed += 1
                print(f"{name}: failed: {traceback.format_exc()}", flush=True)
        measured = [numbers for numbers in runs if numbers]
        if arguments.repeat > 1 and measured:
            failures.table(name, measured)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
