"""Images of a posed scene are those of the library for C++ and of the program.

Usage: renderer_test.py INPUTS SCENE REFERENCE PROGRAM
"""

import pathlib
import subprocess
import sys
import tempfile
import threading
import unittest

import numpy as np

import limn

INPUTS, SCENE, REFERENCE, PROGRAM = pathlib.Path(sys.argv[1]), *sys.argv[2:5]


class Images(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.folder = pathlib.Path(folder.name)
        subprocess.run([REFERENCE, INPUTS, SCENE, cls.folder], check=True)
        cls.rig, cls.scene = limn.Rig.load(INPUTS / "rig"), limn.Scene.load(SCENE)
        cls.posed = cls.scene.load_poses(INPUTS / "poses.json")
        cls.viewer = cls.scene.viewer(cls.posed, cls.rig)
        cls.renderer = limn.Renderer(cls.scene, cls.rig)

    def reference(self, name):
        return np.fromfile(self.folder / f"{name}.rgb", np.uint8).reshape(480, 640, 3)

    def test_of_a_projector(self):
        image = self.renderer.draw_projector(0, self.posed, self.viewer)
        np.testing.assert_array_equal(image, self.reference("projector"))
        self.assertGreater(image.max(), 40)

    def test_of_the_program(self):
        subprocess.run(
            [PROGRAM, "render", "--rig", INPUTS / "rig", "--scene", SCENE, "--poses", INPUTS / "poses.json"]
            + ["--out", self.folder / "out"],
            check=True,
            capture_output=True,
        )
        image = self.renderer.draw_projector(0, self.posed, self.viewer)
        np.testing.assert_array_equal(image, limn.read_image(self.folder / "out/projector-projector0.png"))

    def test_are_drawn_into_an_array_of_the_caller(self):
        memory = np.full((480, 700, 3), 7, np.uint8)
        out = memory[:, 20:660]
        image = self.renderer.draw_projector(0, self.posed, self.viewer, out=out, format="bgr")
        self.assertIs(image, out)
        np.testing.assert_array_equal(image[..., ::-1], self.reference("projector"))
        self.assertTrue((memory[:, :20] == 7).all() and (memory[:, 660:] == 7).all())

    def test_over_a_camera_image(self):
        behind = limn.read_image(INPUTS / "video/image0.png")
        image = self.renderer.draw_composite(0, behind, self.posed, "full")
        np.testing.assert_array_equal(image, self.reference("composite"))
        self.assertFalse((image == behind).all())
        same = self.renderer.draw_composite(0, behind, self.posed, "full", out=behind)
        self.assertTrue(same is behind and (behind == image).all())

    def test_of_a_view(self):
        image = self.renderer.draw_view(self.rig.find("camera0"), self.posed)
        np.testing.assert_array_equal(image, self.reference("view"))

    def test_follow_the_posed_scene(self):
        part = self.posed.parts[0]
        moved = limn.PosedPart(part.slot, part.variant, limn.Pose(translation=(0.05, 0, 0)) * part.world_from_part)
        posed = limn.PosedScene(self.posed.world_from_prototype, [moved])
        image = self.renderer.draw_projector(0, posed, self.viewer)
        self.assertFalse((image == self.reference("projector")).all())
        self.assertGreater((image > 0).sum(), 100)

    def test_refuse_what_cannot_be(self):
        small, grey = np.zeros((2, 2, 3), np.uint8), np.zeros((480, 640), np.uint8)
        read_only = np.zeros((480, 640, 3), np.uint8)
        read_only.flags.writeable = False
        for out, error, text in [
            (small, limn.Error, "expected memory for 640x480 pixels, found a view of 2x2"),
            (grey, limn.Error, "grey"),
            (read_only, ValueError, "found one that is read-only"),
            ([], TypeError, "found list"),
        ]:
            with self.subTest(text=text), self.assertRaisesRegex(error, text):
                self.renderer.draw_projector(0, self.posed, self.viewer, out=out)
        with self.assertRaisesRegex(limn.Error, r"expected a projector below 1 \(projector0\), found 3"):
            self.renderer.draw_projector(3, self.posed, self.viewer)
        with self.assertRaisesRegex(limn.Error, "expected an image of camera0's size 640x480, found 2x2"):
            self.renderer.draw_composite(0, small, self.posed, "rest")
        with self.assertRaisesRegex(ValueError, "expected one of 'rest', 'full', found 'all'"):
            self.renderer.draw_composite(0, small, self.posed, "all")

    def test_in_another_thread(self):
        images = []
        draw = lambda: images.append(self.renderer.draw_projector(0, self.posed, self.viewer))  # noqa: E731
        threads = [threading.Thread(target=draw) for _ in range(2)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        draw()
        self.assertEqual(len(images), 3)
        for image in images:
            np.testing.assert_array_equal(image, self.reference("projector"))


class Scenes(unittest.TestCase):
    def test_name_their_slots_and_bodies(self):
        scene = limn.Scene.load(SCENE)
        self.assertTrue(scene.has_prototype)
        self.assertIn("mirror", [slot.name for slot in scene.slots])
        self.assertIn("prototype", [body.name for body in scene.bodies])
        self.assertTrue(set(scene.families) and scene.folder.is_dir())

    def test_are_posed_by_tracks(self):
        scene = limn.Scene.load(SCENE)
        track = limn.Track("prototype", limn.Pose(translation=(0, 0, 1)), np.eye(6) * 1e-6)
        self.assertEqual(scene.posed([track]).world_from_prototype, track.world_from_body)
        lost = limn.Track("prototype", limn.Pose(), np.eye(6), tracking="lost")
        self.assertIsNone(scene.posed([lost]).world_from_prototype)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
