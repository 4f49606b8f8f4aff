"""Tracks keep a marker's identity while the camera drives, nods and misses some."""

import numpy as np
import pytest
from peaksim.geometry.pose import Pose, interpolate

from peakmark.localise.locate import FloorMap
from peakmark.localise.tracks import PATIENCE, Tracks, displacement, follow
from tests.floor_views import CAMERA, Seen, pose_at, view, winding_map


def drive(
    floor_map: FloorMap, rng: np.random.Generator, step_m: float, frames: int, nod_deg: float = 0.0
) -> list[tuple[Pose, Seen]]:
    """Return the poses and views of a camera that advances along the path, nodding at random, 3 % of markers missed."""
    taken = []
    for k in range(frames):
        at, rest = divmod(k * step_m, 0.28)
        jitter = {"pitch_deg": 35 + nod_deg * rng.standard_normal(), "roll_deg": nod_deg * rng.standard_normal()}
        pose = interpolate(
            pose_at(floor_map, int(at), **jitter), pose_at(floor_map, int(at) + 1, **jitter), rest / 0.28
        )
        seen = view(CAMERA, pose, floor_map, rng, noise_px=0.2)
        taken.append((pose, seen.rows(rng.random(len(seen.xy)) > 0.03)))
    return taken


@pytest.mark.parametrize("step_m", [0.0, 0.02, 0.05, 0.1])
@pytest.mark.parametrize("seed", range(3))
def test_no_identity_is_swapped_or_lost_and_none_is_given_twice(step_m: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    tracks, name_of, id_of = Tracks(), {}, {}
    for _, seen in drive(winding_map(rng, 60), rng, step_m, 60, nod_deg=0.7):
        tracks, ids = follow(tracks, seen.xy, seen.side_px)
        for name, track in zip(seen.names, ids, strict=True):
            assert name_of.setdefault(int(track), int(name)) == name
            assert step_m == 0 or id_of.setdefault(int(name), int(track)) == track
    assert tracks.next_id <= 60


def test_a_track_survives_a_gap_as_long_as_patience_lasts() -> None:
    spot, nothing = np.array([[100.0, 100.0]]), np.empty((0, 2))
    for gap, same in ((PATIENCE, True), (PATIENCE + 1, False)):
        tracks, first = follow(Tracks(), spot, [20])
        for _ in range(gap):
            tracks, ids = follow(tracks, nothing, [])
            assert ids.shape == (0,)
        assert (follow(tracks, spot + 1, [20])[1] == first).all() == same


def test_a_marker_far_from_every_track_is_a_new_one() -> None:
    tracks, _ = follow(Tracks(), [[100, 100], [200, 100]], [20, 20])
    tracks, ids = follow(tracks, [[201, 100], [400, 300]], [20, 20])
    assert ids.tolist() == [1, 2]
    assert [t.misses for t in tracks.tracks] == [1, 0, 0]
    assert [t.hits for t in tracks.tracks] == [1, 2, 1]


def test_displacement_is_a_polynomial_of_the_row() -> None:
    flow = np.array([[1.0, 2.0], [3.0, 4.0]])
    assert np.allclose(displacement(flow, np.array([[7.0, 0.0], [7.0, 500.0]])), [[1, 2], [4, 6]])
    assert np.allclose(displacement(np.zeros((0, 2)), np.array([[7.0, 9.0]])), 0)
