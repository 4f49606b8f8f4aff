#!/usr/bin/env python3
"""Draw docs/images/sensor_NAME.jpg: one view of the SIFT/SURF CAVE as each of the sensors by name takes it."""

from pathlib import Path

import numpy as np
from peaksim import Camera, load_scene, render
from peaksim.camera import apply_sensor, sensor_named
from peaksim.camera.presets import PRESETS
from peaksim.geometry.pose import look_at
from PIL import Image

IMAGES = Path(__file__).resolve().parents[1] / "docs/images"
DETAIL = slice(120, 360), slice(230, 390)
"""Rows and columns that are shown twice as large on the right."""

if __name__ == "__main__":
    scene = load_scene("cave").scene
    frame = render(scene, Camera(640, 480, 480.0), look_at((0.3, 3.3, 1.5), (-1.6, 5.0, 1.35)), "exact")
    for name in PRESETS:
        image = apply_sensor(frame, sensor_named(name, output="rgb"), np.random.default_rng(0)).image
        detail = image[DETAIL].repeat(2, axis=0).repeat(2, axis=1)
        gap = np.full((480, 4, 3), 255, np.uint8)
        Image.fromarray(np.hstack([image, gap, detail])).save(IMAGES / f"sensor_{name}.jpg", quality=88)
