"""Finds the markers of an image, prints their poses and draws them.

Usage: detect_and_draw.py IMAGE FAMILY OUT.png [CAMERA SIDE_MM]
"""

import sys

import matplotlib

matplotlib.use("Agg")  # without a display
import matplotlib.pyplot as plt
import numpy as np

import limn


def draw_axes(axes, pose, side_m, camera):
    """x, y and z of the marker's frame: red, green, blue."""
    # What stands in the camera's frame is seen by the camera at the world's origin.
    lens = camera.placed(limn.Pose())
    for i, colour in enumerate(["red", "lime", "blue"]):
        ends = np.zeros((2, 3))
        ends[1, i] = side_m / 2 if i < 2 else -side_m / 2  # z points into the paper; -z stands on it
        px = lens.project(pose.camera_from_marker * ends)
        axes.plot(px[:, 0], px[:, 1], color=colour, linewidth=2)


def main(image_file, family, out_file, camera_file=None, side_mm="0"):
    image = limn.read_image(image_file)
    camera = limn.Imager.load(camera_file) if camera_file else None
    figure, axes = plt.subplots(figsize=(8, 6), layout="constrained")
    axes.imshow(image)
    for marker in limn.Detector([family]).detect(image, camera):
        corners = np.vstack([marker.corners_px, marker.corners_px[:1]])
        axes.plot(corners[:, 0], corners[:, 1], color="orange")
        axes.annotate(marker.id, marker.corners_px[0], color="orange", fontsize=14)
        print(f"{marker.family}:{marker.id} corner {marker.corners_px[0].round(2)} px, score {marker.score:.3f}")
        if not camera:
            continue
        for i, pose in enumerate(limn.marker_poses(marker, float(side_mm) / 1e3, camera)):
            position_mm = 1e3 * pose.camera_from_marker.translation
            depth_mm = 1e3 * np.sqrt(pose.covariance[5, 5])
            print(f"  at {position_mm.round(1)} mm, {depth_mm:.2f} mm standard deviation in depth, "
                  f"weight {pose.weight:.2f}")  # fmt: skip
            if i == 0:
                draw_axes(axes, pose, float(side_mm) / 1e3, camera)
    axes.set_axis_off()
    figure.savefig(out_file, dpi=100)


if __name__ == "__main__":
    if len(sys.argv) not in (4, 6):
        sys.exit(__doc__)
    try:
        main(*sys.argv[1:])
    except limn.Error as error:
        sys.exit(str(error))
