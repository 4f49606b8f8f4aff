"""Random rooms: nothing shared between the splits, each array once, cameras that see what they were sent to see."""

import numpy as np
import pytest
from peaksim.camera.shutter import still_camera
from peaksim.geometry.pose import invert, transform
from peaksim.truth.markers import marker_truth

from peakmark.errors import InputError
from peakmark.experiments.cave.rooms import CAMERAS, PHOTOGRAPHS, photographs, random_room, random_sensor, random_view
from peakmark.score.arrays import printed_arrays


def test_the_splits_share_no_photograph_and_no_camera() -> None:
    assert not set(PHOTOGRAPHS["training"]) & set(PHOTOGRAPHS["held-out"])
    assert not set(CAMERAS["training"]) & set(CAMERAS["held-out"])
    rng = np.random.default_rng(0)
    for _ in range(20):
        own, other = random_sensor(rng, "training"), random_sensor(rng, "held-out")
        assert own.jpeg_quality == own.full_well_e == own.defocus_px == 0
        assert other.jpeg_quality >= 75
        assert 2000 <= other.full_well_e <= 20_000


@pytest.mark.parametrize("split", ["training", "held-out"])
def test_photographs_are_grey_and_of_moderate_size(split: str) -> None:
    photos = photographs(split)  # type: ignore[arg-type]
    assert set(photos) == set(PHOTOGRAPHS[split])  # type: ignore[index]
    for photo in photos.values():
        assert photo.ndim == 2
        assert photo.dtype == np.uint8
        assert photo.shape[1] <= 513


@pytest.mark.parametrize("seed", range(4))
def test_every_room_prints_each_code_once_on_its_walls(seed: int) -> None:
    room = random_room(np.random.default_rng(seed), photographs("training"))
    printed = [p for p in printed_arrays(room.scene) if p.name in room.arrays]
    assert sorted(p.code for p in printed) == list(range(8))
    for p in printed:
        inside = (p.corners_m > room.min_m - 1e-9) & (p.corners_m < room.max_m + 1e-9)
        assert inside.all()
        assert min(np.abs(p.corners_m[0] - room.min_m).min(), np.abs(p.corners_m[0] - room.max_m).min()) < 0.003


def test_the_same_generator_makes_the_same_room() -> None:
    first, second = (random_room(np.random.default_rng(5), photographs("training")) for _ in range(2))
    assert [q.name for q in first.scene.quads] == [q.name for q in second.scene.quads]
    for a, b in zip(first.scene.quads, second.scene.quads, strict=True):
        assert np.array_equal(a.texture.pixels, b.texture.pixels)
        assert np.array_equal(a.world_from_quad, b.world_from_quad)


@pytest.mark.parametrize("seed", range(3))
def test_a_view_sees_an_array_at_the_asked_distance_and_tilt(seed: int) -> None:
    rng = np.random.default_rng(seed)
    room = random_room(rng, photographs("training"))
    camera = CAMERAS["training"][0]
    pose = random_view(rng, room, 1.2, 30.0)
    assert pose is not None
    assert (pose[:3, 3] > room.min_m).all()
    assert (pose[:3, 3] < room.max_m).all()
    marks = [t for t in marker_truth(room.scene, still_camera(camera, pose)) if t.name.startswith("array")]
    assert min(abs(t.distance_m - 1.2) for t in marks) < 0.06
    middles = np.array([p.place.centers_m.mean(axis=0) for p in printed_arrays(room.scene) if p.name in room.arrays])
    aimed = middles[np.abs(np.linalg.norm(middles - pose[:3, 3], axis=1) - 1.2) < 1e-6]
    assert len(aimed) == 1
    in_camera = transform(invert(pose), aimed)[0]
    assert in_camera[2] > np.cos(np.radians(22)) * 1.2


def test_an_unknown_split_is_refused() -> None:
    with pytest.raises(InputError, match="split: expected training or held-out, got 'test'"):
        photographs("test")  # type: ignore[arg-type]
