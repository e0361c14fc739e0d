"""A scanned surface: its arrays, its files, its alignment.

Usage: scan_test.py INPUTS PROGRAM
"""

import gc
import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

import numpy as np

import limn

INPUTS, PROGRAM = pathlib.Path(sys.argv[1]) / "scan", sys.argv[2]


def points_of_ply(path):
    """x, y, z of the points of a binary PLY whose points begin with these floats."""
    head, _, body = path.read_bytes().partition(b"end_header\n")
    lines = [line.split() for line in head.decode().splitlines()]
    count = next(int(line[2]) for line in lines if line[:2] == ["element", "vertex"])
    elements = [i for i, line in enumerate(lines) if line and line[0] == "element"] + [len(lines)]
    types = {"float": "<f4", "double": "<f8", "uchar": "u1", "int": "<i4", "uint": "<u4"}
    points = np.dtype([(line[2], types[line[1]]) for line in lines[elements[0] : elements[1]] if line[0] == "property"])
    found = np.frombuffer(body, points, count)
    return np.stack([found[name] for name in "xyz"], axis=1)


class Scans(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.folder = pathlib.Path(folder.name)
        cls.stages = []
        cls.scan = limn.scan(
            INPUTS / "captures",
            limn.Rig.load(INPUTS / "rig"),
            cls.folder / "scan",
            progress=lambda progress: cls.stages.append(progress.stage),
        )

    def test_report_their_stages(self):
        self.assertEqual(self.stages, ["scan", "merge", "write"])

    def test_points_are_those_of_the_file(self):
        points = self.scan.points
        self.assertEqual((points.positions.dtype, points.positions.shape[1]), (np.float32, 3))
        self.assertEqual(points.normals.shape, points.positions.shape)
        self.assertEqual(points.stddevs.shape, points.positions.shape[:1])
        np.testing.assert_array_equal(points.positions, points_of_ply(self.folder / "scan/points.ply"))
        np.testing.assert_allclose(np.linalg.norm(points.normals, axis=1), 1, atol=1e-4)

    def test_arrays_are_read_only_views_of_the_surface(self):
        mesh = self.scan.mesh
        self.assertTrue(np.shares_memory(mesh.positions, self.scan.mesh.positions))
        self.assertEqual((mesh.triangles.dtype, mesh.triangles.shape[1]), (np.uint32, 3))
        self.assertLess(mesh.triangles.max(), len(mesh.positions))
        with self.assertRaises(ValueError):
            mesh.positions[0] = 0

    def test_arrays_keep_their_surface(self):
        rig = limn.Rig.load(INPUTS / "rig")
        scan = limn.scan(INPUTS / "captures", rig, self.folder / "again")
        positions = scan.points.positions
        del scan
        gc.collect()
        np.testing.assert_array_equal(positions, self.scan.points.positions)

    def test_are_aligned_as_by_the_program(self):
        options = {"mesh_unit": "metre", "start": INPUTS / "start.json"}
        found = limn.align(self.folder / "scan", INPUTS / "surface.ply", self.folder / "aligned", **options)
        self.assertEqual(found.covariance.shape, (6, 6))
        self.assertGreater(found.used_points, 500)
        self.assertLess(found.rms_m, 1e-3)
        words = ["--scan", self.folder / "scan", "--mesh", INPUTS / "surface.ply", "--units", "m"]
        words += ["--start", INPUTS / "start.json", "--out", self.folder / "program"]
        subprocess.run([PROGRAM, "align", *words], check=True, capture_output=True)
        poses = json.loads((self.folder / "program/poses.json").read_text())
        pose = poses["world_from_prototype"]
        self.assertEqual(found.world_from_prototype, limn.Pose(pose["rotation_wxyz"], pose["translation_m"]))

    def test_say_what_they_refuse(self):
        rig = limn.Rig.load(INPUTS / "rig")
        with self.assertRaisesRegex(limn.Error, "near_m < far_m"):
            limn.scan(INPUTS / "captures", rig, self.folder / "none", near_m=2, far_m=1)
        with self.assertRaisesRegex(ValueError, "expected one of 'metre', 'centimetre', .*, found 'm'"):
            limn.align(self.folder / "scan", INPUTS / "surface.ply", self.folder / "none", mesh_unit="m")


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[3:]])
