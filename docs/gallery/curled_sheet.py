"""A sheet around a pillar.

Paper does not stay flat. The same marker on a flat sheet, rolled outwards, and rolled inwards: lengths on the
paper stay, and the truth is that of the bent surface.
"""

import numpy as np
from peaksim import Bend, Camera, Quad, Scene, Texture, render

from peakmark import identify, marker, overlay

texture = Texture.from_array(np.pad(marker.surf_marker(180), 60, constant_values=255))
camera = Camera(720, 320, 700.0, 700.0, 359.5, 159.5)
sheets = []
for k, bend in enumerate((None, Bend(0.06), Bend(-0.06))):
    pose = np.eye(4)
    pose[0, 3] = 0.17 * (k - 1)
    sheets.append(Quad(f"sheet {k}", texture, (0.13, 0.13), pose, "surf-dark", bend=bend))

world_from_camera = np.diag([1.0, -1.0, -1.0, 1.0])  # x right, y up, looking down at the sheets
world_from_camera[2, 3] = 0.6
frame = render(Scene(tuple(sheets), background=90), camera, world_from_camera, renderer="exact")
found = identify(frame.image)

for one, true in zip(sorted(found, key=lambda one: one.xy[0]), frame.truth, strict=True):
    print(f"{true.name}: off by {np.linalg.norm(one.xy - true.center_xy):.3f} px")
overlay(frame, found).save("curled_sheet.png")
