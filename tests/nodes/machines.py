"""Host and nodes as programs in network and time namespaces of one machine, for tests."""

import csv
import ctypes
import fcntl
import heapq
import itertools
import json
import mmap
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

    def limit(self, megabits):
        """Every machine's cable carries so much, and queues at most 50 ms of it."""
        shape = ["root", "tbf", "rate", f"{megabits}mbit", "burst", "32kb", "latency", "50ms"]
        for number, name in enumerate(self.machines, 1):
            self.in_switch("tc", "qdisc", "add", "dev", f"p{number}", *shape)
            run("ip", "netns", "exec", self.names[name], "tc", "qdisc", "add", "dev", "eth0", *shape)

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

    def __init__(self, limn, folder, network, clock_library=None):
        self.limn, self.folder, self.network, self.clock_library = limn, folder, network, clock_library
        self.programs = []
        shaders = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache"))  # compiled ones are kept
        self.environment = dict(os.environ, HOME=str(folder / "home"), XDG_CACHE_HOME=str(folder / "cache"),
                                XDG_CONFIG_HOME=str(folder / "config"), MESA_SHADER_CACHE_DIR=str(shaders))

    def start(self, name, command, clock_ahead_s=0):
        """A clock's drift and steps are those of the file clock-NAME, if there is one (set_clock)."""
        clock = self.folder / f"clock-{name}"
        if clock.exists():
            command = ["env", f"LD_PRELOAD={self.clock_library}", f"LIMN_TEST_CLOCK={clock}", *command]
        log = open(self.folder / f"{name}.log", "ab")
        program = subprocess.Popen(self.network.command(name, command, clock_ahead_s), stdout=log, stderr=log,
                                   env=self.environment)
        self.programs.append(program)
        return program

    def start_node(self, name, run_number=0, clock_ahead_s=100, extra=(), cache=None):
        """With `cache`, a folder, the node does not share its files with the other nodes here."""
        own = ["env", f"XDG_CACHE_HOME={cache}"] if cache else []
        return self.start(name, [*own, self.limn, "node", "--join", "studio", "--name", name, "--out",
                                 self.folder / f"{name}-{run_number}", *extra], clock_ahead_s)

    def start_host(self, seconds, out="host", extra=(), scene="recording/scene"):
        return self.start("host", [self.limn, "live", "--room", "studio", "--name", "host", "--devices",
                                   self.folder / "devices.json", "--rig", self.folder / "recording/rig", "--scene",
                                   self.folder / scene, "--seconds", seconds, "--out",
                                   self.folder / out, *extra])

    def set_clock(self, name, drift=0.0, step_s=0.0):
        """Makes the clocks of a machine drift and step, of programs that were started after the first call."""
        path = self.folder / f"clock-{name}"
        if not path.exists():
            path.write_bytes(struct.pack("ddd", 0, time.clock_gettime(time.CLOCK_BOOTTIME), 0))
        with open(path, "r+b") as file, mmap.mmap(file.fileno(), 24) as shared:
            shared[0:8], shared[16:24] = struct.pack("d", drift), struct.pack("d", step_s)

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


def prepare(limn, folder, world="studio", nodes=NODES, swaying=None, images=3000):
    """A recorded session in a world of config/, whose camera images the host plays again and again, and devices whose
    projectors are plugged into the nodes in turn. `swaying`: a marker that moves by 50 mm to both sides in a second."""
    environment = dict(os.environ, HOME=str(folder / "home"), XDG_CONFIG_HOME=str(folder / "config"))
    path = Path(__file__).resolve().parents[2] / f"config/worlds/{world}.json"
    sway = {"at_s": 0, "until_s": 9, "sway": swaying, "amplitude_m": [0.05, 0, 0], "hz": 1}
    script = {"schema": "limn.script/1", "seconds": 1, "events": [sway] if swaying else []}
    (folder / "script.json").write_text(json.dumps(script))
    subprocess.run([limn, "live", "--world", path, "--resolution", "0.25", "--script", folder / "script.json", "--record",
                    folder / "recording"], check=True, env=environment, capture_output=True)
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
                for projector, node in zip(rig["projectors"], itertools.cycle(nodes))]
    devices = {"schema": "limn.devices/1", "cameras": [{"name": "camera0", "source": str(film)}],
               "displays": displays}
    (folder / "devices.json").write_text(json.dumps(devices))


def wait_for(limit_s, condition, what, every_s=0.02):
    begun = time.time()
    while not condition():
        assert time.time() - begun < limit_s, f"{what}: not within {limit_s} s"
        time.sleep(every_s)
    return time.time() - begun


def rows_in(path):
    return path.read_text().count("\n") - 1 if path.exists() else 0


def send_osc(machines, name, address, argument=""):
    """Sends an OSC message to port 9000 from within a machine; returns the moment (time.monotonic_ns())."""
    def padded(text):
        return text.encode() + bytes(4 - len(text) % 4)

    message = padded(address) + (padded(",s") + padded(argument) if argument else padded(","))
    program = (f"import socket, time; s = socket.socket(socket.AF_INET, socket.SOCK_DGRAM); print(time.monotonic_ns()); "
               f"s.sendto({message!r}, ('127.0.0.1', 9000))")
    return int(run(*machines.network.command(name, [sys.executable, "-c", program])).stdout)
