"""Plans: functions of specification, seed and index alone; sequences share what they should and nothing else."""

from pathlib import Path

import numpy as np
import pytest
from peaksim.camera import sensor_named
from peaksim.corpus.plan import corpus_cameras, first_frames, open_sequence, plan_frame
from peaksim.errors import SceneError
from peaksim.geometry.pose import look_at
from peaksim.geometry.trajectory import Trajectory
from peaksim.geometry.trajectory_file import save_trajectory

from tests.peaksim.corpus.helpers import tiny_spec

LIGHT = {"ambient": [0.5, 1], "directional": [0.1, 0.4], "elevation_deg": [30, 60]}


def test_a_plan_is_the_same_in_any_order(folder: Path) -> None:
    spec = tiny_spec(light=LIGHT)
    forwards = [plan_frame(spec, folder, i) for i in range(12)]
    open_sequence.cache_clear()
    for i in reversed(range(12)):
        again = plan_frame(spec, folder, i)
        assert np.array_equal(again.world_from_camera, forwards[i].world_from_camera)
        assert (again.sensor, again.camera) == (forwards[i].sensor, forwards[i].camera)
        assert repr(again.scene.lights) == repr(forwards[i].scene.lights)
        assert again.noise().random() == forwards[i].noise().random()


def test_frames_differ_and_sequences_share_scene_and_camera(folder: Path) -> None:
    spec = tiny_spec(
        light=LIGHT,
        markers={"shift_m": [-0.05, 0.05]},
        cameras=[{"name": "a", "width": 64, "height": 48, "fx": [50, 60], "count": 5}],
    )
    plans = [plan_frame(spec, folder, i) for i in range(12)]
    assert len({plan.world_from_camera.tobytes() for plan in plans}) == 12
    assert len({plan.sensor.read_noise for plan in plans}) == 12
    assert len({repr(plan.scene.lights) for plan in plans}) == 12
    for first in (0, 4, 8):
        assert len({plan.sequence.camera.name for plan in plans[first : first + 4]}) == 1
        assert len({id(plan.scene.quads) for plan in plans[first : first + 4]}) == 1
    assert len({plan.scene.quads[-1].world_from_quad.tobytes() for plan in plans}) == 3


def test_light_and_sensor_can_belong_to_the_sequence(folder: Path) -> None:
    spec = tiny_spec(light={**LIGHT, "per": "sequence"}, sensor={"per": "sequence", "exposure": [0.5, 1]})
    plans = [plan_frame(spec, folder, i) for i in range(8)]
    assert len({repr(plan.scene.lights) for plan in plans}) == 2
    assert [plan.sensor for plan in plans[:4]] == [plans[0].sensor] * 4
    assert plans[0].sensor != plans[4].sensor
    assert plans[0].sensor.read_noise == 1.0  # the scene file's


def test_a_directional_light_comes_from_above_at_the_drawn_elevation(folder: Path) -> None:
    for i in range(8):
        ambient, sun = plan_frame(tiny_spec(light=LIGHT), folder, i).scene.lights
        assert (ambient.kind, sun.kind) == ("ambient", "directional")
        assert np.linalg.norm(sun.direction) == pytest.approx(1)
        assert 30 <= np.degrees(np.arcsin(-sun.direction[2])) <= 60


def test_another_seed_is_another_corpus(folder: Path) -> None:
    poses = [plan_frame(tiny_spec(seed=seed), folder, 0).world_from_camera for seed in (1, 2)]
    assert not np.allclose(poses[0], poses[1])


def test_a_flight_runs_along_the_scenes_trajectory_once_a_sequence(folder: Path) -> None:
    plans = [plan_frame(tiny_spec(views=[{"kind": "flight"}]), folder, i) for i in range(8)]
    times = [plan.time_s for plan in plans]
    assert times == pytest.approx([0, 2 / 3, 4 / 3, 2] * 2)
    assert plans[0].world_from_camera[:3, 3] == pytest.approx([-0.5, -0.8, 0.8])
    assert plans[3].world_from_camera[:3, 3] == pytest.approx([0.5, -0.8, 0.8])


def test_a_flight_follows_a_file_beside_the_specification(folder: Path) -> None:
    start, end = (look_at([x, -0.5, 0.7], [x, 0.5, 0.2]) for x in (-0.2, 0.2))
    save_trajectory(Trajectory(np.array([0.0, 1.0]), np.stack([start, end])), folder / "path.txt")
    plan = plan_frame(tiny_spec(views=[{"kind": "flight", "file": "path.txt"}]), folder, 3)
    assert np.allclose(plan.world_from_camera, end, atol=1e-9)


def test_a_flight_that_leaves_the_room_names_the_frame(folder: Path) -> None:
    spec = tiny_spec(views=[{"kind": "flight", "shift_m": 5}])
    with pytest.raises(SceneError, match=r"frame 3: views: expected a view of kind 'flight' inside the room"):
        plan_frame(spec, folder, 3)


def test_scenes_and_views_come_as_often_as_their_weights_say(folder: Path) -> None:
    (folder / "other.toml").write_text((folder / "tiny.toml").read_text().replace("level = 200", "level = 100"))
    spec = tiny_spec(frames=100, sequence_frames=1, scenes=[{"file": "tiny.toml", "weight": 3}, {"file": "other.toml"}])
    files = [open_sequence(spec, folder, i).scene_file for i in range(100)]
    assert files.count("other.toml") == pytest.approx(25, abs=3 * np.sqrt(100 * 3 / 16))


def test_without_cameras_each_scene_keeps_its_own(folder: Path) -> None:
    (camera,) = corpus_cameras(tiny_spec(cameras=[]), folder)
    assert (camera.name, camera.camera.width, camera.camera.fx) == ("scene-000", 64, 50.0)
    assert plan_frame(tiny_spec(cameras=[]), folder, 0).camera == camera.camera


def test_a_camera_of_several_is_numbered_and_drawn_from_its_spread(folder: Path) -> None:
    spec = tiny_spec(
        cameras=[
            {
                "name": "c",
                "width": 64,
                "height": 48,
                "fx": [50, 60],
                "fy": 55,
                "cx": 30,
                "count": 3,
                "distortion": [[-0.2, -0.1], 0, 0, 0],
            }
        ]
    )
    cameras = corpus_cameras(spec, folder)
    assert [camera.name for camera in cameras] == ["c-000", "c-001", "c-002"]
    assert len({camera.camera.fx for camera in cameras}) == 3
    for named in cameras:
        camera = named.camera
        assert (camera.fy, camera.cx, camera.cy) == (55, 30, 23.5)
        assert -0.2 <= camera.distortion[0] <= -0.1


def test_sensors_are_drawn_by_name_and_their_fields_from_spreads(folder: Path) -> None:
    sensor = {"presets": ["phone", "dslr"], "exposure": [0.2, 0.3], "mosaic": ["none", "gbrg"], "hot_seed": 3}
    sensors = [plan_frame(tiny_spec(sensor=sensor), folder, i).sensor for i in range(12)]
    assert {one.name for one in sensors} == {"phone", "dslr"}
    assert {one.mosaic for one in sensors} == {"none", "gbrg"}
    assert all(0.2 <= one.exposure <= 0.3 and one.hot_seed == 3 for one in sensors)
    for one in sensors:
        assert one.full_well_e == sensor_named(one.name).full_well_e


def test_later_fields_that_nobody_states_leave_the_hash_of_a_suite(folder: Path) -> None:
    later = {"presets", "tone", "mosaic", "hot_pixels", "hot_seed", "auto_exposure", "sharpening", "sharpening_px"}
    assert not later & set(tiny_spec().model_dump()["sensor"])
    assert later & set(tiny_spec(sensor={"tone": ["srgb"]}).model_dump()["sensor"]) == {"tone"}


def test_first_frames_show_each_scene_that_comes_once(folder: Path) -> None:
    scenes = [{"file": "tiny.toml"}, {"file": "never.toml", "weight": 0}, {"file": "rare.toml", "weight": 0.3}]
    spec = tiny_spec(scenes=scenes, frames=4000)
    (folder / "rare.toml").write_text((folder / "tiny.toml").read_text())
    firsts = first_frames(spec)
    assert [plan_frame(spec, folder, first).sequence.scene_file for first in firsts] == ["tiny.toml", "rare.toml"]
    earlier = range(0, max(firsts), spec.sequence_frames)
    assert {plan_frame(spec, folder, index).sequence.scene_file for index in earlier} <= {"tiny.toml"}
