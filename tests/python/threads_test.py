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
        with Counter() as counter:
            begun, before = time.perf_counter(), counter.count
            detector.detect(image)
            seconds, counted = time.perf_counter() - begun, counter.count - before
        # Without the GIL the counter would stand still.
        self.assertGreater(counted, 0.05 * seconds / 0.0005, f"in {seconds:.2f} s")
        self.assertGreaterEqual(counted, 5)

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
        timer = threading.Timer(0.1, os.kill, (os.getpid(), signal.SIGINT))
        timer.start()
        with self.assertRaises(KeyboardInterrupt):
            solve(self.out)
        timer.join()
        self.assertFalse(self.out.exists())

    def test_need_a_function(self):
        with self.assertRaisesRegex(TypeError, "progress: expected a function or None, found int"):
            solve(self.out, progress=3)


class Notes(unittest.TestCase):
    """In processes of their own, because the log is one for all."""

    def run_code(self, code):
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
        self.assertEqual(done.returncode, 0, done.stderr)
        return done

    def test_are_given_to_the_function(self):
        done = self.run_code(LOGS + "limn.set_log(log)\nsolve()\nprint(len(lines), lines[0])")
        self.assertRegex(done.stdout, r"^[1-9]\d* \((True|False), '.+'\)")
        self.assertEqual(done.stderr, "")

    def test_are_for_nobody_at_first_and_after_none(self):
        done = self.run_code(LOGS + "solve()\nlimn.set_log(log)\nlimn.set_log(None)\nsolve()\nprint(lines)")
        self.assertEqual((done.stdout, done.stderr), ("[]\n", ""))

    def test_what_the_function_raises_is_reported(self):
        done = self.run_code(LOGS + "limn.set_log(lambda: 1)\nsolve()\nprint('went on')")
        self.assertEqual(done.stdout, "went on\n")
        self.assertIn("TypeError", done.stderr)

    def test_the_interpreter_ends_while_a_thread_logs(self):
        self.run_code(LOGS + "limn.set_log(log)\nimport threading\nthreading.Thread(target=solve).start()")


LOGS = f"""
import limn, tempfile
lines = []
def log(is_warning, line):
    lines.append((is_warning, line))
def solve():
    with tempfile.TemporaryDirectory() as folder:
        limn.solve({str(INPUTS / "photographs")!r}, folder + "/rig", cameras_only=True, board={BOARD!r})
"""

if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
