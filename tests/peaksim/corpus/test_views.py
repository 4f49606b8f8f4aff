"""Views: each drawn pose fulfils what its specification states, measured by the camera's own projection."""

from pathlib import Path

import numpy as np
import pytest
from peaksim.camera.camera import Camera
from peaksim.corpus.draws import frame_draws
from peaksim.corpus.plan import plan_frame
from peaksim.corpus.spec_views import FlightView, MarkerView, RandomView
from peaksim.corpus.views import flight_view, is_free, marker_view, markers_ahead, marks_of, random_view
from peaksim.errors import SceneError
from peaksim.geometry.pose import compose, invert, look_at, pose_distance, rigid, transform
from peaksim.geometry.trajectory import Trajectory
from peaksim.rendering import render
from peaksim.scene.file import load_scene
from peaksim.scene.scene import Scene

from tests.peaksim.corpus.helpers import tiny_spec

CAMERA = Camera(64, 48, 60, 60, 30.5, 25.5, (-0.1, 0.01, 0.001, 0.002))


@pytest.fixture
def scene(folder: Path) -> Scene:
    return load_scene(folder / "tiny.toml").scene


def test_a_marker_view_has_the_drawn_distance_tilt_and_position_in_the_image(scene: Scene) -> None:
    view = MarkerView(kind="marker", distance_m=[0.5, 2], tilt_deg=[0, 70], off_axis=0.5)  # type: ignore[arg-type]
    seen = set()
    for i in range(60):
        draws = frame_draws(1, i)
        pose = rigid(marker_view(view, scene, CAMERA, draws))
        marks = list(marks_of(scene))
        quad, mark = marks[draws.index("view.marker", (1.0,) * len(marks))]
        seen.add(mark.name)
        ray = pose[:3, 3] - quad.world_from_quad[:3, 3]
        assert np.linalg.norm(ray) == pytest.approx(draws.value("view.distance_m", view.distance_m))
        tilt = np.degrees(np.arccos(ray @ quad.world_from_quad[:3, 2] / np.linalg.norm(ray)))
        assert tilt == pytest.approx(draws.value("view.tilt_deg", view.tilt_deg), abs=1e-5)
        xy = CAMERA.project(transform(invert(pose), quad.world_from_quad[:3, 3]))[0]
        assert np.linalg.norm((xy - [31.5, 23.5]) / [32, 24]) == pytest.approx(0.5, abs=1e-6)
    assert seen == {"left", "right", "wall"}


def test_a_marker_view_straight_above_is_no_special_case(scene: Scene) -> None:
    view = MarkerView(kind="marker", distance_m=1, tilt_deg=0, off_axis=0)  # type: ignore[arg-type]
    pose = marker_view(view, scene, CAMERA, frame_draws(0, 0))
    assert markers_ahead(scene, CAMERA, pose) >= 1


def test_a_scene_without_markers_has_no_marker_views() -> None:
    view = MarkerView(kind="marker", distance_m=1)  # type: ignore[arg-type]
    with pytest.raises(SceneError, match="expected a scene with markers"):
        marker_view(view, Scene(), CAMERA, frame_draws(0, 0))


def test_a_random_view_is_in_its_box_looks_at_its_target_and_rolls() -> None:
    view = RandomView(kind="random", eye_m=([0, 1], [2, 3], [1, 2]), target_m=([5, 6], 0, 0), roll_deg=30)  # type: ignore[arg-type]
    for i in range(20):
        pose = rigid(random_view(view, frame_draws(0, i)))
        assert ((pose[:3, 3] >= [0, 2, 1]) & (pose[:3, 3] <= [1, 3, 2])).all()
        along = pose[:3, 3] + pose[:3, 2] * (-pose[2, 3] / pose[2, 2])  # where the axis meets the floor
        assert 5 <= along[0] <= 6
        assert along[1] == pytest.approx(0, abs=1e-9)
        level = look_at(pose[:3, 3], along)
        assert level[:3, 0] @ pose[:3, 0] == pytest.approx(np.cos(np.radians(30)))


def test_a_flight_takes_even_steps_and_shakes_only_when_asked() -> None:
    ends = look_at([0, 0, 1], [0, 5, 0]), look_at([2, 0, 1], [2, 5, 0])
    trajectory = Trajectory(np.array([0.0, 4.0]), np.stack(ends))
    steady = FlightView(kind="flight")
    for position in (0, 0.25, 1):
        pose, time_s = flight_view(steady, trajectory, position, frame_draws(0, 0))
        assert time_s == 4 * position
        assert np.allclose(pose, trajectory.at(time_s), atol=1e-12)
    shaken = FlightView(kind="flight", shift_m=[-0.1, 0.1], shake_deg=[-2, 2])  # type: ignore[arg-type]
    pose, _ = flight_view(shaken, trajectory, 0.5, frame_draws(0, 1))
    shift = pose[:3, 3] - trajectory.at(2)[:3, 3]
    assert (np.abs(shift) > 0).all()
    assert (np.abs(shift) <= 0.1).all()
    assert 0 < pose_distance(pose, trajectory.at(2))[1] <= 2 * np.sqrt(3)


def test_markers_ahead_counts_what_the_truth_says(folder: Path) -> None:
    spec = tiny_spec(
        views=[
            {
                "kind": "random",
                "eye_m": [[-0.9, 0.9], [-0.9, 0.9], [0.3, 1.4]],
                "target_m": [[-0.5, 0.5], [0, 1], [0, 0.5]],
            }
        ],
        cameras=[],
    )
    counts = set()
    for i in range(15):
        plan = plan_frame(spec, folder, i)
        truth = render(plan.scene, plan.camera, plan.world_from_camera, renderer="exact").truth
        expected = sum(bool(plan.camera.contains(t.center_xy[None])[0]) and t.tilt_deg < 90 for t in truth)
        assert markers_ahead(plan.scene, plan.camera, plan.world_from_camera) == expected
        counts.add(expected)
    assert len(counts) > 1


def test_a_camera_in_a_wall_or_in_furniture_is_not_free() -> None:
    setup = load_scene("floor")
    room = np.array([-3.0, 0, 0]), np.array([3, 8, 2.7])
    assert is_free(setup.scene.meshes, room, compose(np.eye(3), [0, 1, 1]))
    assert not is_free(setup.scene.meshes, room, compose(np.eye(3), [0, 1, 2.75]))
    assert is_free(setup.scene.meshes, None, compose(np.eye(3), [0, 1, 2.75]))
    assert not is_free(setup.scene.meshes, room, compose(np.eye(3), [-2.2, 7.2, 1.0]))  # the cupboard
