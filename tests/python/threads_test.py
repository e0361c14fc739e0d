"""Threads, progress, signals, notes.

Usage: threads_test.py INPUTS
"""

import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import threading
import time
import unittest

import numpy as np

import limn

INPUTS = pathlib.Path(sys.argv[1])
BOARD = "charuco:8x6:40mm"


def solve(out, **options):
    return limn.solve(INPUTS / "photographs", out, cameras_only=True, board=BOARD, **options)


class Counter:
    """Counts in a thread, as long as this one lets others run."""

    def __enter__(self):
        self.count, self.is_ended = 0, False
        self.thread = threading.Thread(target=self.run)
        self.thread.start()
        return self

    def run(self):
        while not self.is_ended:
            self.count += 1
            time.sleep(0.0005)

    def __exit__(self, *_):
        self.is_ended = True
        self.thread.join()


class OtherThreads(unittest.TestCase):
    def test_run_while_markers_are_detected(self):
        image = np.random.default_rng(1).integers(0, 255, (2000, 3000), np.uint8)
        detector = limn.Detector(["apriltag_36h11"])
        calls, begun = 0, time.perf_counter()
        with Counter() as counter:
            while counter.count < 10 + 3 * calls and time.perf_counter() - begun < 20:
                detector.detect(image)
                calls += 1
            counted = counter.count
        # If the calls kept the GIL, the counter would count once between two calls.
        self.assertGreaterEqual(counted, 10 + 3 * calls, f"{calls} calls")

    def test_share_a_detector(self):
        image = limn.read_image(INPUTS / "video/image0.png", "grey")
        detector = limn.Detector(["apriltag_36h11"])
        alone = [marker.corners_px.tolist() for marker in detector.detect(image)]
        found = []

        def detect():
            for _ in range(5):
                found.append([marker.corners_px.tolist() for marker in detector.detect(image)])

        threads = [threading.Thread(target=detect) for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        self.assertEqual(found, [alone] * 20)


class LongCalls(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.out = pathlib.Path(folder.name) / "rig"

    def test_report_where_they_are(self):
        stages, threads = [], set()

        def report(progress):
            stages.append(progress.stage)
            threads.add(threading.get_ident())

        with Counter() as counter:
            before = counter.count
            calibration = solve(self.out, progress=report)
            counted = counter.count - before
        self.assertEqual(list(dict.fromkeys(stages)), ["decode", "solve", "assess", "write"])
        self.assertEqual(threads, {threading.get_ident()})  # the calling thread, not another one
        self.assertGreater(counted, 50)
        self.assertTrue(calibration.report_html.is_file())
        self.assertIn(calibration.verdict, ("good", "usable", "reject"))
        self.assertEqual(calibration.devices[0].name, calibration.rig.cameras[0].name)
        self.assertLess(calibration.held_out_rms_px, 1)
        self.assertEqual(limn.Rig.load(self.out).cameras[0].lens_values.tolist(),
                         calibration.rig.cameras[0].lens_values.tolist())  # fmt: skip

    def test_are_stopped_by_false(self):
        with self.assertRaisesRegex(limn.Stopped, "stopped, as was asked for. Nothing was written"):
            solve(self.out, progress=lambda progress: progress.stage != "solve")
        self.assertFalse(self.out.exists())
        self.assertTrue(issubclass(limn.Stopped, limn.Error) and issubclass(limn.Error, RuntimeError))

    def test_are_stopped_by_an_exception_which_the_caller_gets(self):
        def report(progress):
            raise KeyError("no bar")

        with self.assertRaisesRegex(KeyError, "no bar"):
            solve(self.out, progress=report)
        self.assertFalse(self.out.exists())

    def test_are_stopped_by_ctrl_c(self):
        timer = threading.Timer(0.02, os.kill, (os.getpid(), signal.SIGINT))
        with self.assertRaises(KeyboardInterrupt):
            timer.start()
            solve(self.out)
        timer.join()
        self.assertFalse(self.out.exists())

    def test_need_a_function(self):
        with self.assertRaisesRegex(TypeError, "progress: expected a function or None, found int"):
            solve(self.out, progress=3)


# load() loads a camera file with which a note comes: four coefficients may be of two lenses.
LOADS = """
import limn, sys, threading
lines = []
def log(is_warning, line):
    lines.append((is_warning, line))
def load(count=1):
    for _ in range(count):
        limn.Imager.load(sys.argv[1])
"""
CAMERA = """%YAML:1.0
image_width: 640
image_height: 480
camera_matrix: {rows: 3, cols: 3, data: [700, 0, 320, 0, 700, 240, 0, 0, 1]}
distortion_coefficients: {rows: 1, cols: 4, data: [-0.1, 0.05, 0, 0]}
"""


class Notes(unittest.TestCase):
    """In processes of their own, because the log is one for all."""

    def run_code(self, code):
        with tempfile.NamedTemporaryFile("w", suffix=".yml") as camera:
            camera.write(CAMERA)
            camera.flush()
            command = [sys.executable, "-c", LOADS + code, camera.name]
            done = subprocess.run(command, capture_output=True, text=True, timeout=60)
        self.assertEqual(done.returncode, 0, done.stderr)
        return done

    def test_are_given_to_the_function(self):
        done = self.run_code("limn.set_log(log)\nload()\nprint(lines)")
        self.assertRegex(done.stdout, r"^\[\(False, '.*taken as k1, k2, p1, p2 of OpenCV.*'\)\]\n$")
        self.assertEqual(done.stderr, "")

    def test_are_for_nobody_at_first_and_after_none(self):
        done = self.run_code("load()\nlimn.set_log(log)\nlimn.set_log(None)\nload()\nprint(lines)")
        self.assertEqual((done.stdout, done.stderr), ("[]\n", ""))

    def test_what_the_function_raises_is_reported(self):
        done = self.run_code("limn.set_log(lambda: 1)\nload()\nprint('went on')")
        self.assertEqual(done.stdout, "went on\n")
        self.assertIn("TypeError", done.stderr)

    def test_come_from_several_threads_while_the_function_changes(self):
        done = self.run_code(
            """
threads = [threading.Thread(target=load, args=(50,)) for _ in range(3)]
for thread in threads:
    thread.start()
for _ in range(20):
    limn.set_log(log)
    load()
    limn.set_log(None)
print(len(lines) >= 20)
"""
        )
        self.assertEqual((done.stdout, done.stderr), ("True\n", ""))

    def test_the_interpreter_ends_while_a_thread_logs(self):
        for is_daemon in (False, True):
            code = f"limn.set_log(log)\nthreading.Thread(target=load, args=(50,), daemon={is_daemon}).start()\nload()"
            for _ in range(3):
                self.assertEqual(self.run_code(code).stderr, "")


class ProgramsEnd(unittest.TestCase):
    def test_while_daemon_threads_work(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        code = f"""
import limn, threading, time
image = limn.read_image({str(INPUTS / "video/image0.png")!r}, "grey")
def detect():
    detector = limn.Detector(["apriltag_36h11"])
    while True:
        detector.detect(image)
def solve():
    while True:
        limn.solve({str(INPUTS / "photographs")!r}, {folder.name + "/rig"!r}, cameras_only=True, board={BOARD!r},
                   progress=report)
def report(progress):  # Python ends the thread in here
    time.sleep(0.02)
for work in (detect, detect, solve):
    threading.Thread(target=work, daemon=True).start()
time.sleep(0.2)
"""
        for _ in range(2):
            done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
            self.assertEqual((done.returncode, done.stderr), (0, ""))


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[2:]])
