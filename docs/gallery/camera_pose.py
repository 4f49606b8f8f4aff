"""Where the camera is.

What is found, the camera's calibration and a map of the markers give the pose. Drawn
are the world's axes from the first marker, 10 cm each: x red, y green, z blue.
"""

import cv2
import numpy as np
from peaksim import load_scene, render
from peaksim.camera import resized

from peakmark import find, load_map, locate

scene, camera, trajectory = load_scene("cave")
camera, truth = resized(camera, 0.5), trajectory.at(0.0)
frame = render(scene, camera, truth, renderer="exact")
places = load_map("cave")
where = locate(find(frame.image), camera, places)
assert where is not None

off_mm = 1000 * np.linalg.norm(where.world_from_camera[:3, 3] - truth[:3, 3])
print(f"off by {off_mm:.2f} mm in {np.linalg.norm(truth[:3, 3]):.1f} m")

ends = places.centers_m[where.marker_of[0]] + 0.1 * np.vstack([np.zeros(3), np.eye(3)])
camera_from_world = np.linalg.inv(where.world_from_camera)
xy = camera.project(ends @ camera_from_world[:3, :3].T + camera_from_world[:3, 3])
picture = cv2.cvtColor(frame.image, cv2.COLOR_GRAY2BGR) if frame.image.ndim == 2 else frame.image[..., ::-1].copy()
for end, colour in zip(xy[1:], ((40, 40, 220), (60, 160, 40), (220, 120, 20)), strict=True):
    start, stop = (tuple(np.rint(point).astype(int).tolist()) for point in (xy[0], end))
    cv2.arrowedLine(picture, start, stop, colour, 4, cv2.LINE_AA)
cv2.imwrite("camera_pose.png", picture)
