"""Runs a host and its nodes as programs in network and time namespaces of one machine, and breaks things.

    network_test.py LIMN FOLDER [SCENARIO ...]

Needs root. Exit code 77: namespaces are not permitted here.
"""

import csv
import ctypes
import fcntl
import heapq
import json
import os
import random
import select
import signal
import struct
import subprocess
import sys
import threading
import time
from pathlib import Path

NODES = ["left", "right"]
PREFIX = "10.77.0."


def run(*command, check=True):
    return subprocess.run(command, check=check, capture_output=True, text=True)


class Network:
    """A bridge and a namespace for each machine, with addresses 10.77.0.1 and so on."""

    def __init__(self, machines):
        self.machines = machines
        self.names = {name: f"limn-{os.getpid()}-{name}" for name in machines}
        self.switch = f"limn-{os.getpid()}-switch"
        run("ip", "netns", "add", self.switch)
        self.in_switch("ip", "link", "add", "br0", "type", "bridge")
        self.in_switch("ip", "link", "set", "br0", "up")
        for number, name in enumerate(machines, 1):
            namespace = self.names[name]
            run("ip", "netns", "add", namespace)
            port = f"p{number}"
            self.in_switch("ip", "link", "add", port, "type", "veth", "peer", "name", "eth0", "netns", namespace)
            self.in_switch("ip", "link", "set", port, "master", "br0", "up")
            run("ip", "-n", namespace, "addr", "add", f"{PREFIX}{number}/24", "dev", "eth0")
            run("ip", "-n", namespace, "link", "set", "eth0", "up")
            run("ip", "-n", namespace, "link", "set", "lo", "up")

    def in_switch(self, *command):
        run("ip", "netns", "exec", self.switch, *command)

    def plug(self, name, is_plugged):
        self.in_switch("ip", "link", "set", f"p{self.machines.index(name) + 1}", "up" if is_plugged else "down")

    def command(self, name, command, clock_ahead_s=0):
        clock = ["unshare", "--time", "--monotonic", str(clock_ahead_s)] if clock_ahead_s else []
        return ["ip", "netns", "exec", self.names[name], *clock, *map(str, command)]

    def close(self):
        for namespace in [*self.names.values(), self.switch]:
            run("ip", "netns", "del", namespace, check=False)


class NetworkWithoutMulticast(Network):
    """A switch that blocks multicast."""

    def __init__(self, machines):
        super().__init__(machines)
        for namespace in self.names.values():
            run("ip", "-n", namespace, "link", "set", "eth0", "multicast", "off")


class NetworkOfVersion6(Network):
    """A network with IPv6 alone."""

    def __init__(self, machines):
        super().__init__(machines)
        for number, namespace in enumerate(self.names.values(), 1):
            run("ip", "-n", namespace, "addr", "flush", "dev", "eth0")
            run("ip", "-n", namespace, "addr", "add", f"fd77::{number}/64", "dev", "eth0", "nodad")


class LossyNetwork:
    """As Network, with a relay instead of a bridge, which drops packets and delays each by another time."""

    def __init__(self, machines, loss=0.01, jitter_s=0.02):
        self.machines, self.loss, self.jitter_s = machines, loss, jitter_s
        self.names = {name: f"limn-{os.getpid()}-{name}" for name in machines}
        self.is_over = False
        self.ports = []
        for number, name in enumerate(machines, 1):
            namespace = self.names[name]
            run("ip", "netns", "add", namespace)
            self.ports.append(open_tap(namespace))
            run("ip", "-n", namespace, "addr", "add", f"{PREFIX}{number}/24", "dev", "eth0")
            run("ip", "-n", namespace, "link", "set", "eth0", "up")
            run("ip", "-n", namespace, "link", "set", "lo", "up")
        self.relay = threading.Thread(target=self.carry)
        self.relay.start()

    command = Network.command

    def carry(self):
        random_numbers = random.Random(1)
        waiting, number = [], 0  # (due, number, packet, port it came from)
        while not self.is_over:
            limit = 0.05 if not waiting else max(0.0, min(0.05, waiting[0][0] - time.monotonic()))
            for port in select.select(self.ports, [], [], limit)[0]:
                packet = os.read(port, 65536)
                if random_numbers.random() < self.loss:
                    continue
                number += 1
                due = time.monotonic() + random_numbers.uniform(0, self.jitter_s)
                heapq.heappush(waiting, (due, number, packet, port))
            while waiting and waiting[0][0] <= time.monotonic():
                _, _, packet, source = heapq.heappop(waiting)
                for port in self.ports:
                    if port != source:
                        os.write(port, packet)

    def close(self):
        self.is_over = True
        self.relay.join()
        for port in self.ports:
            os.close(port)
        for namespace in self.names.values():
            run("ip", "netns", "del", namespace, check=False)


def open_tap(namespace):
    """A network interface `eth0` in a namespace; returns the file through which its packets come and go."""
    result = []

    def open_inside():
        libc = ctypes.CDLL(None, use_errno=True)
        with open(f"/run/netns/{namespace}") as place:
            assert libc.setns(place.fileno(), 0x40000000) == 0, "setns"  # CLONE_NEWNET, for this thread only
        port = os.open("/dev/net/tun", os.O_RDWR)
        fcntl.ioctl(port, 0x400454CA, struct.pack("16sH", b"eth0", 0x0002 | 0x1000))  # TUNSETIFF: a tap without a header
        result.append(port)

    thread = threading.Thread(target=open_inside)
    thread.start()
    thread.join()
    return result[0]


class Machines:
    """The programs of one scenario."""

    def __init__(self, limn, folder, network):
        self.limn, self.folder, self.network = limn, folder, network
        self.programs = []
        shaders = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache"))  # compiled ones are kept
        self.environment = dict(os.environ, HOME=str(folder / "home"), XDG_CACHE_HOME=str(folder / "cache"),
                                XDG_CONFIG_HOME=str(folder / "config"), MESA_SHADER_CACHE_DIR=str(shaders))

    def start(self, name, command, clock_ahead_s=0):
        log = open(self.folder / f"{name}.log", "ab")
        program = subprocess.Popen(self.network.command(name, command, clock_ahead_s), stdout=log, stderr=log,
                                   env=self.environment)
        self.programs.append(program)
        return program

    def start_node(self, name, run_number=0, clock_ahead_s=100, extra=()):
        return self.start(name, [self.limn, "node", "--join", "studio", "--name", name, "--out",
                                 self.folder / f"{name}-{run_number}", *extra], clock_ahead_s)

    def start_host(self, seconds, out="host", extra=()):
        return self.start("host", [self.limn, "live", "--room", "studio", "--name", "host", "--devices",
                                   self.folder / "devices.json", "--rig", self.folder / "recording/rig", "--scene",
                                   self.folder / "recording/scene", "--seconds", seconds, "--out",
                                   self.folder / out, *extra])

    def end(self):
        for program in self.programs:
            if program.poll() is None:
                program.send_signal(signal.SIGTERM)
        for program in self.programs:
            try:
                program.wait(10)
            except subprocess.TimeoutExpired:
                program.kill()
                raise AssertionError(f"a program did not end: {program.args}")


def fingerprints(path):
    with open(path) as file:
        return {(row["frame"], row["projector"]): row["fingerprint"] for row in csv.DictReader(file)}


def shown(path):
    with open(path) as file:
        return list(csv.DictReader(file))


def prepare(limn, folder, images=3000):
    """A recorded session in the studio, whose camera images the host plays again and again, and devices at nodes."""
    environment = dict(os.environ, HOME=str(folder / "home"), XDG_CONFIG_HOME=str(folder / "config"))
    subprocess.run([limn, "live", "--resolution", "0.25", "--seconds", "1", "--record", folder / "recording"],
                   check=True, env=environment, capture_output=True)
    recorded = sorted((folder / "recording/frames/camera0").iterdir())
    film = folder / "film"
    film.mkdir()
    there_and_back = recorded + recorded[-2:0:-1]
    for number in range(images):
        image = there_and_back[number % len(there_and_back)]
        (film / f"{number:06}{image.suffix}").symlink_to(image)
    subprocess.run([limn, "room", "create", "studio"], check=True, env=environment, capture_output=True)
    rig = json.loads((folder / "recording/rig/rig.json").read_text())
    displays = [{"name": projector["name"], "host": node, "monitor": "offscreen",
                 "size": projector["size"]}
                for projector, node in zip(rig["projectors"], NODES)]
    devices = {"schema": "limn.devices/1", "cameras": [{"name": "camera0", "source": str(film)}],
               "displays": displays}
    (folder / "devices.json").write_text(json.dumps(devices))


def wait_for(limit_s, condition, what):
    begun = time.time()
    while not condition():
        assert time.time() - begun < limit_s, f"{what}: not within {limit_s} s"
        time.sleep(0.02)
    return time.time() - begun


def rows_in(path):
    return path.read_text().count("\n") - 1 if path.exists() else 0


def images_are_the_hosts(machines):
    """Every image that a node shows is the host's, and nearly all frames arrive."""
    for node in NODES:
        machines.start_node(node)
    host = machines.start_host(0)
    paths = [machines.folder / f"{node}-0/shown.csv" for node in NODES]
    wait_for(90, lambda: all(rows_in(path) > 60 for path in paths), "the nodes show images")
    machines.end()
    assert host.returncode == 0, "the host failed"
    wanted = fingerprints(machines.folder / "host/frames.csv")
    for node in NODES:
        rows = shown(machines.folder / f"{node}-0/shown.csv")
        wrong = [row["frame"] for row in rows if wanted[row["frame"], row["projector"]] != row["fingerprint"]]
        assert not wrong, f"{node}: {len(wrong)} of {len(rows)} images differ from the host's: {wrong[:5]}"
        late_ms = sorted(abs(int(row["shown_at_ns"]) - int(row["wanted_at_ns"])) / 1e6 for row in rows[10:])
        print(f"{node}: {len(rows)} images equal; from the wanted moment: median {late_ms[len(late_ms) // 2]:.2f} ms, "
              f"99 % {late_ms[int(0.99 * len(late_ms))]:.2f} ms")


def nobody_freezes_on_a_bad_network(machines):
    """1 % of all packets are lost, and each is delayed by up to 20 ms."""
    for node in NODES:
        machines.start_node(node)
    host = machines.start_host(0)
    paths = [machines.folder / f"{node}-0/shown.csv" for node in NODES]
    wait_for(90, lambda: all(rows_in(path) > 60 for path in paths), "the nodes show images")
    machines.end()
    assert host.returncode == 0, "the host failed"
    wanted = fingerprints(machines.folder / "host/frames.csv")
    for node in NODES:
        rows = shown(machines.folder / f"{node}-0/shown.csv")
        assert all(wanted[row["frame"], row["projector"]] == row["fingerprint"] for row in rows)
        at_s = [int(row["shown_at_ns"]) / 1e9 for row in rows[5:]]
        pauses = [after - before for before, after in zip(at_s, at_s[1:])]
        described = int(rows[-1]["frame"]) - int(rows[5]["frame"])
        print(f"{node}: {len(rows) - 6} of {described} frames shown, the longest pause {max(pauses):.2f} s")
        assert len(rows) - 6 > 0.5 * described and max(pauses) < 1.5, (len(rows), described, max(pauses))


nobody_freezes_on_a_bad_network.network = LossyNetwork


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


def a_killed_node_is_back(machines):
    """kill -9 of a node: the host goes on, and the node shows images at most 3 s after its restart."""
    killed = machines.start_node("left")
    machines.start_node("right")
    host = machines.start_host(0)
    first = machines.folder / "left-0/shown.csv"
    wait_for(60, lambda: rows_in(first) > 10, "the node shows images")
    killed.kill()
    time.sleep(2)
    restarted = time.time()
    machines.start_node("left", 1)
    path = machines.folder / "left-1/shown.csv"
    wait_for(30, lambda: rows_in(path) > 0, "the node shows images again")
    print(f"the node showed images {time.time() - restarted:.1f} s after its restart (with the start of its OpenGL)")
    machines.end()
    assert host.returncode == 0, "the host failed"
    session = json.loads((machines.folder / "host/session.json").read_text())
    notes = json.dumps(session)
    assert "left is not in the room" in notes and "left is in the room" in notes, notes[-2000:]


def the_host_is_killed(machines):
    """kill -9 of the host: the nodes' light is out soon; a new host finds its nodes."""
    for node in NODES:
        machines.start_node(node)
    host = machines.start_host(60)
    logs = {node: machines.folder / f"{node}.log" for node in NODES}
    shown_by = {node: machines.folder / f"{node}-0/shown.csv" for node in NODES}
    wait_for(60, lambda: all(rows_in(path) > 10 for path in shown_by.values()), "both nodes show images")
    killed_at = time.time()
    host.kill()
    wait_for(5, lambda: all("the light is out" in log.read_text() for log in logs.values()), "the light is out")
    dark_s = time.time() - killed_at
    before = {node: rows_in(path) for node, path in shown_by.items()}
    machines.start_host(60, "host-2")
    back_s = wait_for(20, lambda: all(rows_in(path) > before[node] for node, path in shown_by.items()),
                      "the nodes show the new host's images")
    print(f"the light was out {dark_s:.1f} s after the host was killed, and back {back_s:.1f} s after its start")
    machines.end()
    assert dark_s < 1.5, dark_s


def a_link_is_pulled(machines):
    """A node without network is taken over by the other; it shows images again when it is plugged in."""
    for node in NODES:
        machines.start_node(node)
    machines.start_host(60)
    left = machines.folder / "left-0/shown.csv"
    wait_for(60, lambda: rows_in(left) > 10, "the node shows images")
    machines.network.plug("left", False)
    log = machines.folder / "host.log"
    gone_s = wait_for(5, lambda: "left is not in the room" in log.read_text(), "the host misses the node")
    time.sleep(2)
    before = rows_in(left)
    machines.network.plug("left", True)
    back_s = wait_for(15, lambda: rows_in(left) > before + 1, "the node shows images again")
    print(f"the node was missed {gone_s:.1f} s after its link was pulled, and showed images {back_s:.1f} s after it was "
          f"plugged in (the log is written once a second)")
    machines.end()


def a_second_host_is_refused(machines):
    machines.start_host(12)
    time.sleep(4)
    second = machines.start("left", [machines.limn, "live", "--room", "studio", "--name", "second", "--devices",
                                     machines.folder / "devices.json", "--rig", machines.folder / "recording/rig",
                                     "--scene", machines.folder / "recording/scene", "--seconds", "1"])
    assert second.wait(20) == 1
    assert "expected no host in it, found host" in (machines.folder / "left.log").read_text()
    machines.end()


SCENARIOS = [images_are_the_hosts, nobody_freezes_on_a_bad_network, machines_meet_without_multicast,
             machines_meet_by_ipv6, a_killed_node_is_back, the_host_is_killed, a_link_is_pulled,
             a_second_host_is_refused]


def main():
    limn, folder = Path(sys.argv[1]).resolve(), Path(sys.argv[2]).resolve()
    if os.geteuid() != 0 or run("ip", "netns", "add", "limn-probe", check=False).returncode != 0:
        print("skipped: network namespaces need root")
        return 77
    run("ip", "netns", "del", "limn-probe", check=False)
    chosen = [scenario for scenario in SCENARIOS if not sys.argv[3:] or scenario.__name__ in sys.argv[3:]]
    for scenario in chosen:
        place = folder / scenario.__name__
        subprocess.run(["rm", "-rf", place], check=True)
        place.mkdir(parents=True)
        prepare(limn, place)
        network = getattr(scenario, "network", Network)(["host", *NODES])
        machines = Machines(limn, place, network)
        try:
            scenario(machines)
            print(f"{scenario.__name__}: passed")
        finally:
            for program in machines.programs:
                program.kill()
            network.close()
    return 0


if __name__ == "__main__":
    sys.exit(main())
