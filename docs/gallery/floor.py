"""A floor that shows the way.

A path of markers on the floor of a hall. The camera's pitch is known, so that each row of the image is stretched by
what the floor loses there: the small flat markers far away are then found, too.
"""

from peaksim import load_scene, render

from peakmark import identify, overlay
from peakmark.identification.stretch import floor_stretch

scene, camera, trajectory = load_scene("hall")
frame = render(scene, camera, trajectory.at(0.0), renderer="exact")
found = identify(frame.image, stretch=floor_stretch(camera, pitch_deg=34))

near = [one for one in frame.truth if one.visible_fraction == 1 and one.side_px >= 10]
print(f"{len(found)} markers found; {len(near)} are whole and of 10 px and more")
overlay(frame, found).save("floor.png")
