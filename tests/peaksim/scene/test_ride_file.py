"""Ride files: the shipped ones load, and each fault is one line with the field."""

from pathlib import Path

import numpy as np
import pytest
from peaksim.errors import SceneError
from peaksim.geometry.trajectory_file import save_trajectory
from peaksim.scene.ride_file import TRAJECTORIES, load_ride, shortened

SCENE = """
[camera]
width = 320
height = 240
fx = 280.0
[[trajectory]]
eye_m = [0.0, 0.5, 0.7]
target_m = [0.0, 1.5, 0.0]
[room]
min_m = [-2.0, 0.0, 0.0]
max_m = [2.0, 6.0, 2.5]
[[marker_paths]]
name = "t"
kind = "surf-dark"
count = 5
side_m = 0.08
waypoints_m = [[0.0, 1.0], [0.0, 3.0]]
"""
RIDE = """
scene = "{scene}"
[drive]
path = "t"
height_m = 0.7
pitch_deg = 30
speed_m_s = 0.5
"""


@pytest.fixture
def ride(tmp_path: Path) -> Path:
    (tmp_path / "scene.toml").write_text(SCENE)
    path = tmp_path / "ride.toml"
    path.write_text(RIDE.format(scene=tmp_path / "scene.toml"))
    return path


@pytest.mark.parametrize("scene", ["/etc/passwd", "../../etc/passwd"])
def test_a_ride_opens_no_scene_outside_its_folder(ride: Path, scene: str) -> None:
    ride.write_text(RIDE.format(scene=scene))
    with pytest.raises(SceneError, match=f"ride.toml: scene: expected a path inside .*, got '{scene}'"):
        load_ride(ride)


def test_a_ride_names_a_scene_beside_it_wherever_it_is_loaded_from(ride: Path) -> None:
    ride.write_text(RIDE.format(scene="scene.toml"))
    assert load_ride(ride)[0].camera.width == 320


@pytest.mark.parametrize("name", sorted(p.stem for p in TRAJECTORIES.glob("*.toml")))
def test_the_shipped_rides_load_and_have_200_frames_or_more(name: str) -> None:
    setup, ride = load_ride(name)
    assert len(ride.trajectory.frame_times_s(ride.frames_per_second)) >= 200
    assert ride.mount is not None
    assert len([m for q in setup.scene.quads for m in q.marks]) >= 40
    assert ride.longest_step_m() < 0.15


def test_a_ride_starts_before_the_path_and_ends_at_its_end(ride: Path) -> None:
    _, loaded = load_ride(ride)
    y = loaded.trajectory.world_from_camera[:, 1, 3]
    assert (y[0], y[-1]) == pytest.approx((0.5, 3.0), abs=0.05)
    assert loaded.camera.width == 320
    first = shortened(loaded, 7)
    assert len(first.trajectory) == 7
    assert np.allclose(first.trajectory.world_from_camera, loaded.trajectory.world_from_camera[:7])


def test_poses_of_another_tool_fly_too(ride: Path, tmp_path: Path) -> None:
    _, loaded = load_ride(ride)
    file = tmp_path / "poses.tum"
    save_trajectory(loaded.trajectory, file)
    _, again = load_ride(file, scene=str(tmp_path / "scene.toml"))
    assert again.mount is None
    assert again.frames_per_second == pytest.approx(10)
    assert np.allclose(again.trajectory.at(1.0), loaded.trajectory.at(1.0), atol=1e-6)
    with pytest.raises(SceneError, match="expected --scene beside a file of poses"):
        load_ride(file)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("speed_m_s = 0.5", "sped_m_s = 0.5", r"drive\.sped_m_s: unknown field \(did you mean 'speed_m_s'\?\)"),
        ('path = "t"', 'path = "q"', "drive.path: expected one of t, got 'q'"),
        ('path = "t"', "", "expected exactly one of path and waypoints_m"),
        (
            'path = "t"',
            "waypoints_m = [[0.0, 1.0], [5.0, 1.0]]",
            r"expected a camera inside the room .* at 5\.\d s it is at",
        ),
        ("height_m = 0.7", "height_m = -1", r"drive\.height_m: input should be greater than 0"),
        ("speed_m_s = 0.5", "speed_m_s = 0.5\nend_m = -3", "expected start, stops and end in rising order"),
        ("speed_m_s = 0.5", "speed_m_s = 0.5\n[sensor]\nnoise = 3", r"sensor\.noise: unknown field"),
    ],
)
def test_faults_are_one_line(ride: Path, old: str, new: str, message: str) -> None:
    ride.write_text(ride.read_text().replace(old, new))
    with pytest.raises(SceneError, match=message) as caught:
        load_ride(ride)
    assert "\n" not in str(caught.value)
    assert str(ride) in str(caught.value)


def test_a_ride_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"nowhere\.toml: cannot be read"):
        load_ride(tmp_path / "nowhere.toml")
