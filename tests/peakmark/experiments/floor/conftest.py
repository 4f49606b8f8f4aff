"""A small scene to fly through."""

from pathlib import Path

import pytest

SCENE = """
[camera]
width = 480
height = 360
fx = 400.0
[sensor]
read_noise = 2.0
[[trajectory]]
eye_m = [0.0, 0.3, 0.6]
target_m = [0.0, 1.3, 0.0]
[textures.floor]
variants = { gravel = "textures/gravel.png", brick = "textures/brick.png" }
contrast = 0.5
[room]
min_m = [-1.5, 0.0, 0.0]
max_m = [1.5, 5.0, 2.0]
floor = "floor"
[[marker_paths]]
name = "t"
kind = "surf-dark"
count = 12
side_m = 0.08
border_m = 0.01
waypoints_m = [[0.0, 0.8], [0.25, 1.7], [-0.2, 2.6], [0.1, 3.6]]
"""
RIDE = """
scene = "{scene}"
frames_per_second = 10
[drive]
path = "t"
height_m = 0.6
pitch_deg = 36
speed_m_s = 0.6
start_m = -0.4
end_m = 0.1
[light]
low = 0.7
high = 1.1
period_s = 2
"""


@pytest.fixture(scope="package")
def ride(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("ride")
    (folder / "scene.toml").write_text(SCENE)
    path = folder / "ride.toml"
    path.write_text(RIDE.format(scene=folder / "scene.toml"))
    return path
