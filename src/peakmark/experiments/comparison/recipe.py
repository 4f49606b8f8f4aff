"""Frames by the recipe of another benchmark of tags, render-tag's `locus_v1_tag36h11`, drawn by our renderer.

https://github.com/NoeFontana/render-tag, configs/benchmarks/single_tag/locus_v1_tag36h11.yaml: Full HD, 70° across, one
print on a textured floor in the middle of the image, 5 to 40 pixels a module of a tag of 8 modules, the cosine of the
tilt from 0.5 to 1, any roll. Not taken over are its renderer (Blender), its lamps and its film's tone curve.
"""

import numpy as np
from numpy.typing import NDArray
from peaksim.camera.camera import Camera
from peaksim.camera.sensor import Sensor, capture_image
from peaksim.geometry.pose import Pose, compose, rotation_about
from peaksim.rendering import render

from peakmark.experiments.comparison.boards import Print, seen_prints
from peakmark.experiments.comparison.frames import Shot, board_scene
from peakmark.experiments.comparison.prints import IDS, SIDE_M, Design

_FOCAL_PX = 960.0 / np.tan(np.radians(35.0))
CAMERA = Camera(1920, 1080, _FOCAL_PX, _FOCAL_PX, 959.5, 539.5)

PX_PER_MODULE = (5.0, 40.0)
MODULES = 8
COS_TILT = (0.5, 1.0)
"""Evenly drawn. Our prints are 6 cm, not 16: distances are as much smaller."""

_SENSOR = Sensor(0.4, exposure=0.7, read_noise=0.5, tone="srgb")
"""σ of the noise: the recipe's 0.002 of the range; of the lens: about Blender's filter of pixels."""

_FLOOR_M = 8.0


def recipe_shot(design: Design, rng: np.random.Generator) -> Shot:
    """Return one print alone; streams that are alike give the same pose to every design."""
    pose = recipe_pose(rng)
    board = (Print(design, int(rng.integers(2**16)) % IDS[design], 0.0, 0.0, 0.0),)
    frame = render(board_scene(board, rng, wall_m=_FLOOR_M), CAMERA, pose, "exact")
    linear: NDArray[np.float32] = np.asarray(frame.linear, dtype=np.float32)
    return Shot(capture_image(linear, _SENSOR, rng), board, seen_prints(board, pose, CAMERA), pose, CAMERA)


def recipe_pose(rng: np.random.Generator) -> Pose:
    """Return world from camera: it looks at the print's middle, from where the recipe has it."""
    distance_m = CAMERA.fx * SIDE_M / (MODULES * rng.uniform(*PX_PER_MODULE))
    tilt_deg = np.degrees(np.arccos(rng.uniform(*COS_TILT)))
    turn = rotation_about("z", rng.uniform(0, 360)) @ rotation_about("x", tilt_deg)
    turn = turn @ rotation_about("z", rng.uniform(-180, 180)) @ np.diag([1.0, -1.0, -1.0])
    return compose(turn, -distance_m * turn[:, 2])
