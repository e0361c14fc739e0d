"""Results are those of the library for C++ to the bit, and messages are those of the program.

Usage: same_as_cpp_test.py INPUTS REFERENCE PROGRAM
"""

import pathlib
import subprocess
import sys
import tempfile
import unittest

import numpy as np

import limn

INPUTS, REFERENCE, PROGRAM = pathlib.Path(sys.argv[1]), sys.argv[2], sys.argv[3]
VIDEO = INPUTS / "video"


def reference():
    """Each result of the C++ program by its name."""
    results = {}
    for line in subprocess.check_output([REFERENCE, str(INPUTS)], text=True).splitlines():
        name, *numbers = line.split()
        results[name] = [float.fromhex(number) for number in numbers]
    return results


class SameAsCpp(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.reference = reference()
        cls.camera = limn.Imager.load(VIDEO / "camera0.cameramodel")
        cls.compared = set()

    @classmethod
    def tearDownClass(cls):
        left = set(cls.reference) - cls.compared
        assert not left, f"not compared: {sorted(left)[:5]}"

    def same(self, name, numbers):
        self.compared.add(name)
        # Not nearly: every bit.
        self.assertEqual(np.asarray(numbers, dtype=float).ravel().tolist(), self.reference[name], name)

    def same_pose(self, name, pose):
        self.same(f"{name}.rotation", pose.rotation_wxyz)
        self.same(f"{name}.translation", pose.translation)
        self.same(f"{name}.matrix", pose.matrix())
        self.same(f"{name}.inverse", pose.inverse().matrix())
        self.same(f"{name}.moved", pose * (0.1, -0.2, 0.3))
        self.same(f"{name}.moved", (pose * np.array([[0.1, -0.2, 0.3], [0, 0, 1]]))[0])

    def same_tracks(self, name, tracks):
        self.assertEqual(len(tracks), 1)
        track = tracks[0]
        self.same_pose(name, track.world_from_body)
        self.same(f"{name}.covariance", track.covariance)
        self.same(f"{name}.fit", [track.rms_px, track.captured_at_s, track.at_s])
        self.assertEqual((track.body, track.marker_count, track.tracking), ("body", 2, "measured"))

    def test_lenses(self):
        self.same("lens", self.camera.lens_values)
        px = np.array([[13.0 * i, 9.5 * i] for i in range(50)])
        d_world = self.camera.unproject(px)
        back = self.camera.project(d_world)
        for i, (d, pixel) in enumerate(zip(d_world, back, strict=True)):
            if f"ray{i}" not in self.reference:
                self.assertTrue(np.isnan(d).all())
                self.assertIsNone(self.camera.ray(px[i]))
                continue
            self.same(f"ray{i}", d)
            self.same(f"ray{i}", self.camera.unproject(px[i]))
            self.same(f"ray{i}", self.camera.ray(px[i]).d)
            self.same(f"pixel{i}", pixel)
            self.same(f"pixel{i}", self.camera.project(tuple(d)))

    def test_markers(self):
        image = limn.read_image(VIDEO / "image0.png", "grey")
        markers = limn.Detector(["apriltag_36h11"]).detect(image, self.camera)
        self.assertEqual({marker.id for marker in markers}, {"0", "1"})
        for marker in markers:
            name = f"marker:{marker.family}:{marker.id}"
            for i in range(4):
                self.same(f"{name}.corner{i}", marker.corners_px[i])
                self.same(f"{name}.covariance{i}", marker.corner_covariances[i])
            self.same(f"{name}.score", [marker.score])
            poses = limn.marker_poses(marker, 0.08, self.camera)
            self.assertGreaterEqual(len(poses), 1)
            for i, pose in enumerate(poses):
                self.same_pose(f"{name}.pose{i}", pose.camera_from_marker)
                self.same(f"{name}.pose{i}.covariance", pose.covariance)
                self.same(f"{name}.pose{i}.fit", [pose.rms_px, pose.weight])

    def test_tracks(self):
        body = limn.load_body(VIDEO / "body.json", "body")
        self.assertEqual(len(body.markers), 2)
        detector, tracker = limn.Detector(limn.families_of([body])), limn.Tracker([body])
        for i in range(3):
            image = limn.read_image(VIDEO / f"image{i}.png", "grey")
            views = [(self.camera, detector.detect(image, self.camera))]
            self.same_tracks(f"located{i}", limn.locate_bodies([body], views))
            tracker.update(views, 0.03 * i)
            self.same_tracks(f"predicted{i}", tracker.predict(0.03 * i + 0.02))


class Messages(unittest.TestCase):
    """Those of the program, without what it puts before and after them."""

    def message_of_program(self, *words):
        done = subprocess.run([PROGRAM, *words], capture_output=True, text=True)
        self.assertEqual(done.returncode, 1, done.stderr)
        return done.stderr.splitlines()[0].removeprefix("limn: ")

    def test_a_missing_image(self):
        with self.assertRaises(limn.Error) as raised:
            limn.read_image("none.png")
        self.assertEqual(str(raised.exception), self.message_of_program("detect", "none.png"))

    def test_a_missing_rig(self):
        with tempfile.TemporaryDirectory() as folder:
            with self.assertRaises(limn.Error) as raised:
                limn.Rig.load(f"{folder}/none")
            words = ["render", "--rig", f"{folder}/none", "--scene", ".", "--poses", "p.json", "--out", folder]
            self.assertIn(str(raised.exception), self.message_of_program(*words))

    def test_captures_that_are_none(self):
        with tempfile.TemporaryDirectory() as folder:
            with self.assertRaises(limn.Error) as raised:
                limn.solve(folder, f"{folder}/rig")
            self.assertEqual(str(raised.exception), self.message_of_program("solve", folder, "--out", f"{folder}/rig"))

    def test_a_name_that_is_no_utf8(self):
        with self.assertRaisesRegex(limn.Error, r"none\\xff"):
            limn.read_image(b"none\xff.png")


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
