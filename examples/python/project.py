"""Projects a part: draws each projector's image of a scene, here with one part moved by 30 mm, without a display.

Usage: project.py RIG SCENE POSES.json OUT
"""

import pathlib
import sys

import numpy as np

import limn


def main(rig_folder, scene_folder, poses_file, out):
    rig, scene = limn.Rig.load(rig_folder), limn.Scene.load(scene_folder)
    posed = scene.load_poses(poses_file)
    out = pathlib.Path(out)
    out.mkdir(parents=True, exist_ok=True)

    first, *others = posed.parts
    sideways = limn.Pose(translation=(0.03, 0, 0))  # in the part's own frame
    moved = limn.PosedPart(first.slot, first.variant, first.world_from_part * sideways)
    scenes = {"": posed, "-moved": limn.PosedScene(posed.world_from_prototype, [moved, *others], posed.viewpoints)}

    renderer = limn.Renderer(scene, rig)
    print(renderer.gl_description)
    for name, shown in scenes.items():
        viewer = scene.viewer(shown, rig)
        for i, projector in enumerate(rig.projectors):
            image = np.empty((projector.height, projector.width, 3), np.uint8)  # could be a window's memory
            renderer.draw_projector(i, shown, viewer, out=image)
            limn.write_png(out / f"projector-{projector.name}{name}.png", image)
        for camera in rig.cameras:
            limn.write_png(out / f"view-{camera.name}{name}.png", renderer.draw_view(camera, shown))


if __name__ == "__main__":
    if len(sys.argv) != 5:
        sys.exit(__doc__)
    try:
        main(*sys.argv[1:])
    except limn.Error as error:
        sys.exit(str(error))
