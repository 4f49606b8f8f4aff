"""One view, four cameras.

The same linear image, taken by sensors as they are: their lens, noise, tone curve and JPEG.
"""

import numpy as np
from peaksim import load_scene, render
from peaksim.camera.presets import PRESETS
from peaksim.camera.sensor import apply_sensor

from peakmark import identify, overlay

scene, camera, trajectory = load_scene("hall")
frame = render(scene, camera, trajectory.at(0.0), renderer="exact")

views = []
for name, sensor in PRESETS.items():
    taken = apply_sensor(frame, sensor, np.random.default_rng(0))
    found = identify(taken.image)
    print(f"{name}: {len(found)} markers")
    views.append(overlay(taken, found).pixels)
overlay(np.vstack([np.hstack(views[:2]), np.hstack(views[2:])])).save("sensors.png")
