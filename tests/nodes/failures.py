"""Scenarios in which a machine fails. Each returns its numbers, by name, for the table of many runs.

The host's clock is this test's, so stamps in shown.csv can be compared with time.monotonic_ns().
"""

import json
import os
import re
import shutil
import signal
import subprocess
import time
from pathlib import Path

from machines import NODES, fingerprints, rows_in, shown, wait_for

SETTLED_ROWS = 60  # of each node, before something is broken


def begin(machines, nodes=NODES):
    """Starts the host and its nodes; returns the host and the nodes' programs when all show images."""
    programs = {node: machines.start_node(node) for node in nodes}
    host = machines.start_host(0)
    for node in nodes:
        path = machines.folder / f"{node}-0/shown.csv"
        wait_for(60, lambda path=path: rows_in(path) > SETTLED_ROWS, f"{node} shows images")
    return host, programs


def rows_between(path, begin_ns, end_ns):
    return [row for row in shown(path) if begin_ns <= int(row["wanted_at_ns"]) <= end_ns]


def lost_frames(path, begin_ns, end_ns):
    """Frames that a node did not show between two moments."""
    numbers = [int(row["frame"]) for row in rows_between(path, begin_ns, end_ns)]
    assert numbers, f"{path}: expected images, found none"
    return numbers[-1] - numbers[0] + 1 - len(set(numbers))


def longest_pause_s(path, begin_ns, end_ns):
    at = [int(row["shown_at_ns"]) for row in rows_between(path, begin_ns, end_ns)]
    return max((after - before for before, after in zip(at, at[1:])), default=0) / 1e9


def first_shown_s(path, since_ns):
    """How long after a moment a node showed its first image."""
    later = [int(row["shown_at_ns"]) for row in shown(path) if int(row["shown_at_ns"]) > since_ns]
    return (min(later) - since_ns) / 1e9


def different_images(host_log, paths):
    """Images that differ from the host's, of those that the host logged; and how many were compared."""
    wanted = fingerprints(host_log)
    pairs = [(wanted[row["frame"], row["projector"]], row["fingerprint"])
             for path in paths for row in shown(path) if (row["frame"], row["projector"]) in wanted]
    assert pairs, f"{host_log}: expected images of the nodes, found none"
    return sum(ours != theirs for ours, theirs in pairs), len(pairs)


def while_broken(machines, begin_ns, end_ns):
    """What the other node missed meanwhile, and, as every machine here shares two cores, in an equal time before."""
    path = machines.folder / "right-0/shown.csv"
    before_ns = max(2 * begin_ns - end_ns, int(shown(path)[5]["wanted_at_ns"]))
    return {"frames of the other node": len(rows_between(path, begin_ns, end_ns)),
            "of these lost": lost_frames(path, begin_ns, end_ns),
            "longest pause of the other node, s": longest_pause_s(path, begin_ns, end_ns),
            "frames of the other node before": len(rows_between(path, before_ns, begin_ns)),
            "of these lost before": lost_frames(path, before_ns, begin_ns),
            "longest pause before, s": longest_pause_s(path, before_ns, begin_ns)}


def compared(machines, paths, host="host"):
    different, count = different_images(machines.folder / f"{host}/frames.csv", paths)
    assert different == 0, f"{different} of {count} images differ from the host's"
    return {"images compared, all equal": count}


def a_killed_node_is_back(machines):
    """kill -9 of a node: the host goes on, and the node shows images at most 3 s after its restart."""
    host, programs = begin(machines)
    killed_ns = time.monotonic_ns()
    programs["left"].kill()
    log = machines.folder / "host.log"
    missed_s = wait_for(5, lambda: "left is not in the room" in log.read_text(), "the host misses the node")
    time.sleep(1.5)
    alone_ns = restarted_ns = time.monotonic_ns()
    machines.start_node("left", 1)
    path = machines.folder / "left-1/shown.csv"
    wait_for(30, lambda: rows_in(path) > 0, "the node shows images again")
    time.sleep(1)
    back_s = first_shown_s(path, restarted_ns)
    machines.end()
    assert host.returncode == 0, "the host failed"
    notes = json.dumps(json.loads((machines.folder / "host/session.json").read_text()))
    assert "left is not in the room" in notes and "left is in the room" in notes, notes[-2000:]
    assert back_s < 6, back_s
    return {"missed after, s": missed_s, "images after its restart, s": back_s,
            **while_broken(machines, killed_ns, alone_ns),
            **compared(machines, [machines.folder / "right-0/shown.csv", path])}


def the_host_is_killed(machines):
    """kill -9 of the host: the nodes' light is out soon; a new host finds its nodes."""
    host, _ = begin(machines)
    logs = [machines.folder / f"{node}.log" for node in NODES]
    paths = [machines.folder / f"{node}-0/shown.csv" for node in NODES]
    host.kill()
    dark_s = wait_for(5, lambda: all("the light is out" in log.read_text() for log in logs), "the light is out")
    before = {path: rows_in(path) for path in paths}
    time.sleep(0.5)
    restarted_ns = time.monotonic_ns()
    machines.start_host(0, "host-2")
    wait_for(60, lambda: all(rows_in(path) > before[path] for path in paths), "the nodes show the new host's images")
    time.sleep(1)
    machines.end()
    back_s = max(first_shown_s(path, restarted_ns) for path in paths)
    wanted = fingerprints(machines.folder / "host-2/frames.csv")
    later = [row for path in paths for row in shown(path) if int(row["shown_at_ns"]) > restarted_ns]
    assert all(wanted[row["frame"], row["projector"]] == row["fingerprint"] for row in later)
    assert dark_s < 1.5, dark_s
    return {"light out after, s": dark_s, "images after the host's restart, s": back_s,
            "images compared, all equal": len(later)}


def a_link_is_pulled(machines):
    """A node without network is missed; it shows images again when it is plugged in."""
    host, _ = begin(machines)
    pulled_ns = time.monotonic_ns()
    machines.network.plug("left", False)
    log, left_log = machines.folder / "host.log", machines.folder / "left.log"
    missed_s = wait_for(5, lambda: "left is not in the room" in log.read_text(), "the host misses the node")
    dark_s = missed_s + wait_for(5, lambda: "the light is out" in left_log.read_text(), "the node's light is out")
    time.sleep(2)
    path = machines.folder / "left-0/shown.csv"
    before = rows_in(path)
    plugged_ns = time.monotonic_ns()
    machines.network.plug("left", True)
    wait_for(15, lambda: rows_in(path) > before + 1, "the node shows images again")
    time.sleep(1)
    end_ns = time.monotonic_ns()
    machines.end()
    assert host.returncode == 0, "the host failed"
    return {"missed after, s": missed_s, "its light out after, s": dark_s,
            "images after it was plugged in, s": first_shown_s(path, plugged_ns),
            **while_broken(machines, pulled_ns, end_ns),
            **compared(machines, [machines.folder / f"{node}-0/shown.csv" for node in NODES])}


def a_clock_steps(machines):
    """A node's clocks step by 5 s, forwards and, in every second run, backwards."""
    step_s = -5 if machines.run_number % 2 else 5
    machines.set_clock("left", drift=50e-6)
    host, programs = begin(machines)
    assert machines.clock_library.name in Path(f"/proc/{programs['left'].pid}/maps").read_text(), "the clock is not ours"
    stepped_ns = time.monotonic_ns()
    machines.set_clock("left", drift=50e-6, step_s=step_s)
    time.sleep(4)
    end_ns = time.monotonic_ns()
    machines.end()
    assert host.returncode == 0, "the host failed"
    path = machines.folder / "left-0/shown.csv"
    rows = rows_between(path, stepped_ns, end_ns)
    wrong = [row for row in rows if abs(int(row["shown_at_ns"]) - int(row["wanted_at_ns"])) > 1e9]
    right_again_s = (int(wrong[-1]["wanted_at_ns"]) - stepped_ns) / 1e9 if wrong else 0.0
    wanted_ns = [int(row["wanted_at_ns"]) for row in rows]
    assert len(wanted_ns) > 1, "the node shows no images after the step"
    pause_s = max(after - before for before, after in zip(wanted_ns, wanted_ns[1:])) / 1e9
    assert right_again_s < 2 and pause_s < 1.5, (right_again_s, pause_s)
    return {"clock right again after, s": right_again_s, "longest pause of the node itself, s": pause_s,
            **while_broken(machines, stepped_ns, end_ns),
            **compared(machines, [machines.folder / f"{node}-0/shown.csv" for node in NODES])}


def a_node_sleeps(machines):
    """A laptop that sleeps for 10 s: nothing runs, and on waking its clock is behind by as much."""
    machines.set_clock("left")
    host, programs = begin(machines)
    slept_ns = time.monotonic_ns()
    programs["left"].send_signal(signal.SIGSTOP)
    log, left_log = machines.folder / "host.log", machines.folder / "left.log"
    missed_s = wait_for(5, lambda: "left is not in the room" in log.read_text(), "the host misses the node")
    time.sleep(10 - missed_s)
    path = machines.folder / "left-0/shown.csv"
    before = rows_in(path)
    machines.set_clock("left", step_s=-10)
    woken_ns = time.monotonic_ns()
    programs["left"].send_signal(signal.SIGCONT)
    # The first image after the sleep may be the one that it was about to show.
    wait_for(15, lambda: rows_in(path) > before + 4, "the node shows images again")
    time.sleep(1)
    machines.end()
    assert host.returncode == 0, "the host failed"
    assert "this program did not run for 1" in left_log.read_text(), left_log.read_text()[-2000:]
    back_s = (int(shown(path)[before + 3]["wanted_at_ns"]) - woken_ns) / 1e9
    assert back_s < 6, back_s
    return {"missed after, s": missed_s, "images after waking, s": back_s,
            **while_broken(machines, slept_ns, woken_ns),
            **compared(machines, [machines.folder / f"{node}-0/shown.csv" for node in NODES])}


def a_full_disk_is_named(machines):
    """A node whose cache has no room says so, also at the host, and shows images when there is some."""
    cache = machines.folder / "small"
    cache.mkdir()
    subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", cache], check=True)
    try:
        machines.start_node("right")
        machines.start_node("left", cache=cache)
        host = machines.start_host(0)
        path, log, host_log = (machines.folder / name for name in ("left-0/shown.csv", "left.log", "host.log"))
        message = "expected room for the session's files, found: No space left on device. Free some space there"
        wait_for(60, lambda: message in log.read_text(), "the node names the full disk")
        wait_for(10, lambda: message in host_log.read_text(), "the host names the full disk")
        assert rows_in(path) == 0
        freed_ns = time.monotonic_ns()
        subprocess.run(["mount", "-o", "remount,size=64m", cache], check=True)
        wait_for(20, lambda: rows_in(path) > 10, "the node shows images")
        machines.end()
        assert host.returncode == 0, "the host failed"
        return {"images after there was room, s": first_shown_s(path, freed_ns), **compared(machines, [path])}
    finally:
        for program in machines.programs:
            program.kill()
            program.wait()
        subprocess.run(["umount", cache], check=True)


def a_large_scene_comes_while_frames_run(machines):
    """A node without files joins a session whose scene has 30 MB, on cables of 100 Mbit/s."""
    machines.network.limit(100)
    scene = machines.folder / "large"
    shutil.copytree((machines.folder / "recording/scene").resolve(), scene)
    (scene / "texture.bin").write_bytes(os.urandom(30_000_000))
    machines.start_node("right", cache=machines.folder / "cache-right")
    host = machines.start_host(0, scene="large")
    right = machines.folder / "right-0/shown.csv"
    wait_for(60, lambda: rows_in(right) > SETTLED_ROWS, "right shows images")
    time.sleep(5)
    begin_ns = time.monotonic_ns()
    machines.start_node("left", cache=machines.folder / "cache-left")
    log = machines.folder / "left.log"
    wait_for(30, lambda: "files from the host" in log.read_text(), "left has the files")
    end_ns = time.monotonic_ns()
    left = machines.folder / "left-0/shown.csv"
    wait_for(20, lambda: rows_in(left) > 5, "left shows images")
    machines.end()
    assert host.returncode == 0, "the host failed"
    megabytes, fetched_s = re.search(r"([\d.]+) MB in ([\d.]+) s", log.read_text()).groups()
    assert float(megabytes) > 30 and float(fetched_s) < 5, (megabytes, fetched_s)
    return {"30 MB came in, s": float(fetched_s), **while_broken(machines, begin_ns, end_ns),
            **compared(machines, [right, left])}


SCENARIOS = [a_killed_node_is_back, the_host_is_killed, a_link_is_pulled, a_clock_steps, a_full_disk_is_named]


def table(name, runs):
    """The median and the worst of each number in several runs, as rows of a table."""
    print(f"{name}: {len(runs)} runs\n| number | median | worst |\n|---|---|---|")
    for number in runs[0]:
        values = sorted(run[number] for run in runs)
        worst = values[0] if "images compared" in number or number.startswith("frames of") else values[-1]
        form = "{:.0f}" if isinstance(values[0], int) else "{:.2f}"
        print(f"| {number} | {form.format(values[len(values) // 2])} | {form.format(worst)} |")
