"""Posters with numbers.

Three markers are three bits: light is 1, dark is 0. Any image of the room tells which posters are in it.
"""

from peaksim import load_scene, render
from peaksim.camera import resized

from peakmark import find, overlay

scene, camera, trajectory = load_scene("cave")
frame = render(scene, resized(camera, 0.5), trajectory.at(0.0), renderer="exact")
found = find(frame.image)

for array in found.arrays:
    print("poster", array.code, "at", array.xy.round(1))
overlay(frame, found).save("posters.png")
