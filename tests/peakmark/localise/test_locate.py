"""The camera in a map of markers without names: right or None, never wrong."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from peakmark.errors import InputError
from peakmark.localise.floor import floor_of_pose
from peakmark.localise.locate import FEWEST, FloorMap, locate
from peakmark.localise.pose import CERTAIN
from peakmark.localise.residuals import refined_sigmas
from tests.floor_views import CAMERA, SIDE_M, Seen, apart, pose_at, view, winding_map

views = {
    "seed": st.integers(0, 2**32 - 1),
    "height": st.floats(0.6, 1.4),
    "pitch": st.floats(25, 45),
    "roll": st.floats(-8, 8),
}


def as_refined(seen: Seen, rng: np.random.Generator) -> Seen:
    """Return what is seen with the errors of refined markers."""
    center_sigma, shape_sigma = refined_sigmas(seen.affinity)
    return Seen(
        seen.names,
        seen.xy + center_sigma[:, None] * rng.standard_normal(seen.xy.shape),
        seen.affinity + shape_sigma[:, None, None] * rng.standard_normal(seen.affinity.shape),
    )


@settings(max_examples=30, deadline=None)
@given(**views, foreign=st.integers(0, 2))
def test_every_answer_is_right_although_markers_are_missed_and_others_made_up(
    seed: int, height: float, pitch: float, roll: float, foreign: int
) -> None:
    rng = np.random.default_rng(seed)
    floor_map = winding_map(rng)
    pose = pose_at(floor_map, int(rng.integers(0, 30)), height, pitch, roll, rng.uniform(-0.15, 0.15))
    seen = as_refined(view(CAMERA, pose, floor_map, rng), rng)
    seen = seen.rows(rng.random(len(seen.xy)) > 0.1)
    xy = np.concatenate([seen.xy, rng.uniform(50, 700, (foreign, 2))])
    shapes = np.concatenate([seen.affinity, rng.uniform(10, 40, (foreign, 1, 1)) * np.eye(2)])
    found = locate(CAMERA, floor_map, xy, shapes)
    if len(seen.xy) >= 8 and foreign == 0:
        assert found is not None
    if found is not None:
        distance, angle = apart(found.world_from_camera, pose)
        assert distance < 0.04
        assert angle < (0.6 if len(seen.xy) >= 8 else 2.0)  # a short row of markers hardly tells the rotation about it
        matched = found.marker_of[: len(seen.xy)]
        assert ((matched == seen.names) | (matched == -1)).all()
        assert found.margin >= CERTAIN


@settings(max_examples=25, deadline=None)
@given(**views)
def test_sizes_alone_serve_too_or_give_none(seed: int, height: float, pitch: float, roll: float) -> None:
    rng = np.random.default_rng(seed)
    floor_map = winding_map(rng, bend=0.15)
    pose = pose_at(floor_map, 8, height, pitch, roll)
    seen = view(CAMERA, pose, floor_map, rng, noise_px=0.15)
    sides = seen.side_px * np.exp(rng.normal(0, 0.04, len(seen.xy)))
    found = locate(CAMERA, floor_map, seen.xy, side_px=sides)
    if found is not None:
        assert apart(found.world_from_camera, pose)[0] < 0.15


def test_a_straight_even_row_is_unsure_until_tracking_says_where() -> None:
    rng = np.random.default_rng(0)
    row = winding_map(rng, bend=0.0)
    pose = pose_at(row, 15)
    seen = view(CAMERA, pose, row, rng, noise_px=0.05)
    assert locate(CAMERA, row, seen.xy, seen.affinity) is None
    guess = pose_at(row, 15, aside_m=0.04)
    tracked = locate(CAMERA, row, seen.xy, seen.affinity, near=guess)
    assert tracked is not None
    assert apart(tracked.world_from_camera, pose)[0] < 0.02


def test_a_guess_that_is_wrong_gives_none() -> None:
    rng = np.random.default_rng(0)
    floor_map = winding_map(rng, bend=0.3)
    seen = view(CAMERA, pose_at(floor_map, 15), floor_map, rng)
    assert locate(CAMERA, floor_map, seen.xy, seen.affinity, near=pose_at(floor_map, 20)) is None


@pytest.mark.parametrize("seed", range(8))
def test_a_map_of_another_floor_gives_none(seed: int) -> None:
    rng = np.random.default_rng(seed)
    here, elsewhere = winding_map(rng, bend=0.15), winding_map(rng, bend=0.4)
    seen = view(CAMERA, pose_at(here, 15), here, rng, noise_px=0.1)
    assert locate(CAMERA, here, seen.xy, seen.affinity) is not None
    assert locate(CAMERA, elsewhere, seen.xy, seen.affinity) is None


def test_a_map_of_the_wrong_marker_size_gives_none() -> None:
    rng = np.random.default_rng(1)
    floor_map = winding_map(rng)
    seen = view(CAMERA, pose_at(floor_map, 15), floor_map, rng, noise_px=0.1)
    assert locate(CAMERA, FloorMap(floor_map.centers_m, 1.5 * SIDE_M), seen.xy, seen.affinity) is None


@pytest.mark.parametrize("count", range(FEWEST))
def test_fewer_markers_than_a_pose_needs_give_none(count: int) -> None:
    rng = np.random.default_rng(0)
    floor_map = winding_map(rng)
    seen = view(CAMERA, pose_at(floor_map, 15), floor_map, rng).rows(np.arange(count))
    assert locate(CAMERA, floor_map, seen.xy, seen.affinity) is None


def test_bad_input_is_named() -> None:
    floor_map = winding_map(np.random.default_rng(0))
    with pytest.raises(InputError, match="expected affinity or side_px, got neither"):
        locate(CAMERA, floor_map, np.zeros((5, 2)))
    with pytest.raises(InputError, match="expected one shape or side a centre, got 4 for 5"):
        locate(CAMERA, floor_map, np.zeros((5, 2)), side_px=np.ones(4))
    with pytest.raises(InputError, match=r"map: expected markers on one level"):
        FloorMap(np.array([[0, 0, 0], [0, 0, 1.0]]), 0.08)
    with pytest.raises(InputError, match=r"map: expected finite \(m, 3\) centres"):
        FloorMap(np.array([[0, np.nan, 0]]), 0.08)
    with pytest.raises(InputError, match="map: expected a side above 0 m, got 0"):
        FloorMap(np.zeros((1, 3)), 0)


MIRRORED = np.diag([1.0, 1.0, -1.0, 1.0])


def test_a_mirrored_start_is_refused() -> None:
    floor_map = winding_map(np.random.default_rng(0))
    with pytest.raises(InputError, match=r"near: expected a rigid transform .* got a mirrored one"):
        locate(CAMERA, floor_map, np.zeros((9, 2)), side_px=np.full(9, 20.0), near=MIRRORED)
    with pytest.raises(InputError, match=r"world_from_camera: expected a rigid transform .* got a mirrored one"):
        floor_of_pose(MIRRORED)
