"""numpy's arrays: what is read and written where it is, and what is refused."""

import gc
import pathlib
import pickle
import sys
import tempfile
import tracemalloc
import unittest

import numpy as np

import limn

VIDEO = pathlib.Path(sys.argv[1]) / "video"


def largest_memory(call):
    """What numpy held at most during a call, in bytes."""
    tracemalloc.start()
    try:
        call()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


class Images(unittest.TestCase):
    def setUp(self):
        self.image = limn.read_image(VIDEO / "image0.png", "grey")
        self.detector = limn.Detector(["apriltag_36h11"])

    def corners(self, image, **options):
        return sorted((marker.id, marker.corners_px.tolist()) for marker in self.detector.detect(image, **options))

    def test_are_uint8_in_their_shape(self):
        colour = limn.read_image(VIDEO / "image0.png")
        self.assertEqual((self.image.dtype, self.image.shape, colour.shape), (np.uint8, (480, 640), (480, 640, 3)))
        self.assertTrue(self.image.flags.writeable and self.image.flags.c_contiguous)

    def test_rows_may_have_gaps(self):
        wide = np.zeros((480, 1000), np.uint8)
        wide[:, 100:740] = self.image
        self.assertEqual(self.corners(wide[:, 100:740]), self.corners(self.image))
        colour = np.full((480, 700, 3), 9, np.uint8)
        colour[:, :640] = self.image[..., None]
        self.assertEqual(self.corners(colour[:, :640]), self.corners(self.image))

    def test_grey_is_read_where_it_is(self):
        # Every second row, without a copy: the stride is two rows.
        self.assertEqual(self.corners(self.image[::2]), self.corners(self.image[::2].copy()))
        read_only = self.image.copy()
        read_only.flags.writeable = False
        self.assertEqual(self.corners(read_only), self.corners(self.image))

    def test_are_not_copied(self):
        self.detector.detect(self.image)
        size = self.image.nbytes
        self.assertGreater(largest_memory(self.image.copy), size)  # so numpy's memory is counted
        self.assertLess(largest_memory(lambda: self.detector.detect(self.image)), 0.1 * size)
        self.assertLess(largest_memory(lambda: self.detector.detect(self.image[:, 100:])), 0.1 * size)
        self.assertLess(largest_memory(lambda: limn.read_image(VIDEO / "image0.png", "grey")), 0.1 * size)

    def test_the_order_of_colours_is_said(self):
        with tempfile.TemporaryDirectory() as folder:
            bgr = np.zeros((2, 3, 3), np.uint8)
            bgr[..., 0] = 200
            limn.write_png(f"{folder}/blue.png", bgr, format="bgr")
            self.assertEqual(limn.read_image(f"{folder}/blue.png")[0, 0].tolist(), [0, 0, 200])
            self.assertEqual(limn.read_image(f"{folder}/blue.png", "bgr").tolist(), bgr.tolist())
            limn.write_png(f"{folder}/red.png", bgr)
            self.assertEqual(limn.read_image(f"{folder}/red.png")[0, 0].tolist(), [200, 0, 0])

    def test_what_cannot_be_is_refused(self):
        for image, error, text in [
            (self.image.astype(float), TypeError, "expected a numpy array of uint8, found one of float64"),
            (self.image.astype(np.uint16), TypeError, "found one of uint16"),
            (self.image.astype(bool), TypeError, "found one of bool"),
            ([[1, 2]], TypeError, "expected a numpy array of uint8, found list"),
            (self.image[::-1], ValueError, r"found strides \(-640, 1\). Use numpy.ascontiguousarray"),
            (self.image[:, ::2], ValueError, r"found strides \(640, 2\)"),
            (self.image.T, ValueError, r"found strides \(1, 640\)"),
            (np.broadcast_to(self.image[0], (480, 640)), ValueError, r"found strides \(0, 1\)"),
            (self.image[0], ValueError, r"\(height, width\) or \(height, width, 3\), found shape \(640,\)"),
            (np.zeros((4, 4, 4), np.uint8), ValueError, r"found shape \(4, 4, 4\)"),
            (np.zeros((0, 640), np.uint8), limn.Error, "found .*640x0"),
        ]:
            with self.subTest(text=text), self.assertRaisesRegex(error, text):
                self.detector.detect(image)
        with self.assertRaisesRegex(ValueError, "expected one of 'grey', 'rgb', 'bgr', found 'RGB'"):
            self.detector.detect(self.image, format="RGB")

    def test_sides_of_one_have_no_stride(self):
        column = np.zeros((5, 7), np.uint8)[:, 3:4]
        row = np.zeros((5, 7), np.uint8)[::-1][:1]
        for image in (column, row, np.zeros((1, 1, 3), np.uint8)):
            self.assertEqual(self.detector.detect(image), [])

    def test_memory_of_results_is_their_own(self):
        marker = limn.draw_marker("aruco_4x4_50", "3", 4)
        before = marker.copy()
        gc.collect()
        limn.draw_marker("aruco_4x4_50", "4", 4)
        self.assertTrue((marker == before).all())
        self.assertEqual(marker.ndim, 2)


class Numbers(unittest.TestCase):
    def setUp(self):
        self.pose = limn.Pose((0.8, 0, 0.6, 0), (1, 2, 3))

    def test_views_share_their_owners_memory(self):
        self.assertTrue(np.shares_memory(self.pose.translation, self.pose.translation))
        view = limn.Pose(translation=(7, 8, 9)).translation
        gc.collect()
        self.assertEqual(view.tolist(), [7, 8, 9])  # the view keeps its pose

    def test_do_not_change(self):
        with self.assertRaises(ValueError):
            self.pose.translation[0] = 5
        with self.assertRaises(AttributeError):
            self.pose.translation = (1, 2, 3)
        body = limn.Body("b", [limn.BodyMarker("aruco_4x4_50", "1", 0.04)])
        self.assertIsInstance(body.markers, tuple)
        with self.assertRaises(AttributeError):
            body.markers[0].size_m = 1

    def test_points_are_read_where_they_are_or_converted(self):
        camera = limn.Imager.pinhole("c", 640, 480, 60, limn.Pose())
        points = np.array([[0.1, 0.2, 1.0], [0, 0, 2], [0, 0, -1]])
        px = camera.project(points)
        self.assertEqual(px.shape, (3, 2))
        self.assertTrue(np.isnan(px[2]).all())
        self.assertEqual(px[1].tolist(), [319.5, 239.5])
        for other in (points.tolist(), np.asfortranarray(points), np.repeat(points, 2, axis=0)[::2]):
            np.testing.assert_array_equal(camera.project(other), px)
        self.assertEqual(camera.project(np.zeros((0, 3))).shape, (0, 2))
        for bad, error in [("abc", TypeError), (None, TypeError), (points[:, :2], ValueError), (np.zeros(4), ValueError)]:
            with self.assertRaisesRegex(error, r"expected an array of"):
                camera.project(bad)

    def test_points_are_not_copied(self):
        camera, points = limn.Imager.pinhole("c", 640, 480, 60, limn.Pose()), np.ones((10000, 3))
        camera.project(points)
        pixels = 2 * 8 * len(points)
        self.assertLess(largest_memory(lambda: camera.project(points)), 1.1 * pixels)
        self.assertGreater(largest_memory(lambda: camera.project(points.astype(np.float32))), 1.1 * pixels)

    def test_shapes_are_named(self):
        with self.assertRaisesRegex(ValueError, r"expected an array of shape \(4,\), found shape \(3,\)"):
            limn.Pose((1, 0, 0))
        with self.assertRaisesRegex(TypeError, r"expected an array of numbers of shape \(3,\), found str 'here'"):
            limn.looking_at("here", (0, 0, 0), (0, 0, 1))
        with self.assertRaisesRegex(limn.Error, "expected a 4 x 4 matrix with a rotation"):
            limn.Pose.from_matrix(np.ones((4, 4)))

    def test_poses_multiply(self):
        self.assertEqual(self.pose * self.pose.inverse() * limn.Pose(), self.pose * self.pose.inverse())
        np.testing.assert_allclose((self.pose * self.pose.inverse()).matrix(), np.eye(4), atol=1e-15)
        np.testing.assert_allclose(limn.Pose.from_matrix(self.pose.matrix()).matrix(), self.pose.matrix(), atol=1e-15)
        self.assertNotEqual(self.pose, limn.Pose())
        with self.assertRaises(TypeError):
            np.zeros(3) * self.pose

    def test_are_pickled(self):
        track = limn.Track("b", self.pose, np.eye(6), tracking="lost")
        again = pickle.loads(pickle.dumps(track))
        self.assertEqual((again.world_from_body, again.tracking), (self.pose, "lost"))
        np.testing.assert_array_equal(again.covariance, np.eye(6))
        self.assertEqual(eval(repr(self.pose), {"Pose": limn.Pose}), self.pose)

    def test_markers_of_another_detector(self):
        camera = limn.Imager.load(VIDEO / "camera0.cameramodel")
        image = limn.read_image(VIDEO / "image0.png", "grey")
        found = limn.Detector(["apriltag_36h11"]).detect(image, camera)[0]
        same = limn.Marker(found.family, found.id, found.corners_px, found.corner_covariances, found.corner_visible)
        self.assertEqual(
            limn.marker_poses(same, 0.08, camera)[0].camera_from_marker,
            limn.marker_poses(found, 0.08, camera)[0].camera_from_marker,
        )
        self.assertFalse(np.shares_memory(same.corners_px, found.corners_px))


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[2:]])
