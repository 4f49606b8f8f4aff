"""Arrays: every code from every side, under noise and clutter; doubt instead of a wrong code."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from peakmark import decode_arrays
from peakmark.errors import InputError
from peakmark.identification.detection import Detection
from peakmark.markers.array_code import THREE_BIT, Layout, polarities_of
from peakmark.markers.patterns import Polarity
from tests.peakmark.arrays.arrays_scene import CAMERA, SIDE_M, Printed, detections, facing_wall, printed_array

SIZE = (CAMERA.width, CAMERA.height)
CODES = st.integers(0, 7)
PITCH_M = THREE_BIT.pitch * SIDE_M


@given(CODES, st.floats(0.5, 4), st.floats(0, 45), st.floats(0, 360), st.floats(0, 360))
def test_every_code_is_read_from_every_side(
    code: int, distance: float, tilt: float, direction: float, roll: float
) -> None:
    seen, shapes = detections(printed_array(code), facing_wall(distance, tilt, direction, roll))
    for affinity in (None, shapes):
        (found,) = decode_arrays(seen, affinity=affinity, image_size=SIZE)
        assert (found.code, found.doubt) == (code, "")
        assert [d.id for d in found.detections] == [0, 1, 2]
        assert np.allclose(found.xy, np.mean([d.xy for d in seen], axis=0))


@given(CODES, st.floats(45, 70), st.floats(0, 360), st.floats(0, 360))
def test_steep_views_are_read_with_shapes_and_never_wrongly_without(
    code: int, tilt: float, direction: float, roll: float
) -> None:
    seen, shapes = detections(printed_array(code), facing_wall(1.5, tilt, direction, roll))
    assert [a.code for a in decode_arrays(seen, affinity=shapes)] == [code]
    if tilt < 47:
        assert [a.code for a in decode_arrays(seen)] == [code]


@given(CODES, st.floats(0.5, 4), st.floats(0, 45), st.floats(0, 360), st.floats(0, 360), st.integers(0, 2**32))
def test_noise_of_centres_and_sizes_never_makes_a_wrong_code(
    code: int, distance: float, tilt: float, direction: float, roll: float, seed: int
) -> None:
    pose = facing_wall(distance, tilt, direction, roll)
    seen, _ = detections(printed_array(code), pose, np.random.default_rng(seed), center_noise=0.02, size_noise=0.06)
    assert {a.code for a in decode_arrays(seen)} <= {code, None}


def test_all_eight_side_by_side_in_one_view_in_any_order() -> None:
    printed = [m for code in range(8) for m in printed_array(code, (0.3 * (code % 4) - 0.45, 0.3 * (code // 4) - 0.15))]
    seen, shapes = detections(printed, facing_wall(2.0, 30, 100, 77))
    order = np.random.default_rng(1).permutation(len(seen))
    for affinity in (None, shapes[order]):
        found = decode_arrays([seen[i] for i in order], affinity=affinity, image_size=SIZE)
        assert [a.code for a in found] == list(range(8))
        assert [[d.id for d in a.detections] for a in found] == [[3 * c, 3 * c + 1, 3 * c + 2] for c in range(8)]


def test_the_rows_of_a_rotated_poster_are_those_of_the_poster() -> None:
    for angle in (0, 90, 180, 270, 33):
        seen, _ = detections(printed_array(4, rotation_deg=angle), facing_wall(1.0, 10, 50, 0))
        assert [a.code for a in decode_arrays(seen)] == [4]


def test_noise_rates() -> None:
    """Of noisy views to 45° at least 99 % are read, none wrongly."""
    rng = np.random.default_rng(5)
    outcomes = []
    for _ in range(500):
        code = int(rng.integers(8))
        pose = facing_wall(rng.uniform(0.5, 4), rng.uniform(0, 45), rng.uniform(0, 360), rng.uniform(0, 360))
        seen, _ = detections(printed_array(code), pose, rng, center_noise=0.01, size_noise=0.05)
        codes = [a.code for a in decode_arrays(seen)]
        outcomes.append(codes == [code])
        assert set(codes) <= {code, None}
    assert np.mean(outcomes) >= 0.99


def test_clutter_does_not_disturb_arrays_that_keep_their_distance() -> None:
    rng = np.random.default_rng(6)
    for _ in range(60):
        code = int(rng.integers(8))
        own = printed_array(code)
        cells = np.array([(-PITCH_M / 2, PITCH_M / 2), *(p.xy_m for p in own)])
        foreign = [p for p in scattered(rng, 40) if np.linalg.norm(cells - p.xy_m, axis=1).min() > 1.45 * PITCH_M]
        pose = facing_wall(rng.uniform(1, 3), rng.uniform(0, 40), rng.uniform(0, 360), rng.uniform(0, 360))
        seen, shapes = detections(own + foreign, pose, rng, center_noise=0.01)
        found = [a for a in decode_arrays(seen, affinity=shapes) if {0, 1, 2} & {d.id for d in a.detections}]
        assert [(a.code, a.doubt) for a in found] == [(code, "")]


def scattered(rng: np.random.Generator, count: int) -> list[Printed]:
    """Return markers of different sizes on the wall; paper does not overlap."""
    markers: list[Printed] = []
    while len(markers) < count:
        xy, side = rng.uniform(-0.6, 0.6, 2), SIDE_M * float(rng.choice([0.5, 0.8, 1.0, 1.3, 2.0]))
        if all(np.hypot(*(xy - m.xy_m)) > 0.75 * (side + m.side_m) for m in markers):
            polarity: Polarity = "light" if rng.random() < 0.5 else "dark"
            markers.append(Printed((float(xy[0]), float(xy[1])), polarity, side))
    return markers


@given(CODES, st.integers(0, 2), st.floats(0, 45), st.floats(0, 360))
def test_two_markers_are_no_array(code: int, missing: int, tilt: float, roll: float) -> None:
    printed = printed_array(code)
    del printed[missing]
    seen, _ = detections(printed, facing_wall(1.0, tilt, 20, roll))
    assert decode_arrays(seen) == ()


def test_nothing_is_found_among_too_few_markers() -> None:
    assert decode_arrays(()) == () == decode_arrays((), rule="paper")
    seen, _ = detections(printed_array(3)[:1], facing_wall(1, 0, 0, 0))
    assert decode_arrays(seen) == () == decode_arrays(seen, rule="paper")


def test_a_full_block_is_no_array_and_one_that_the_border_cuts_is_unsure() -> None:
    block = [*printed_array(5), Printed((-PITCH_M / 2, PITCH_M / 2), "dark")]
    seen, _ = detections(block, facing_wall(1.0, 20, 0, 0))
    assert decode_arrays(seen, image_size=SIZE) == ()
    pose = facing_wall(0.5, 0, 0, -45)
    pose[:3, 3] += 0.236 * pose[:3, 0]
    cut, _ = detections(block, pose)
    assert cut[3].xy[0] < -0.5 < min(d.xy[0] for d in cut[:3]) - 1
    assert [(a.code, a.doubt) for a in decode_arrays(cut[:3], image_size=SIZE)] == [
        (None, "the blank corner lies outside the image")
    ]


def test_ghosts_and_duplicates_are_ignored() -> None:
    seen, _ = detections(printed_array(6), facing_wall(1.0, 30, 60, 200))
    ghosts = []
    for d in seen:
        other: Polarity = "light" if d.polarity == "dark" else "dark"
        for k, angle in enumerate(np.radians([45, 135, 225, 315])):
            away = 0.21 * d.size * np.array([np.cos(angle), np.sin(angle)])
            ghosts.append(Detection(100 + k, d.xy + away, 0.45 * d.size, other, 0.16 * d.response, 0.6, 50))
        ghosts.append(Detection(200, d.xy + 1.0, 1.2 * d.size, d.polarity, 0.9 * d.response, 0.2, 60))
    assert [a.code for a in decode_arrays(ghosts + seen)] == [6]


@pytest.mark.parametrize("gap", [0.7, 0.85, 1.0, 1.1, 1.2])
def test_arrays_closer_than_their_pitch_are_never_read_wrongly(gap: float) -> None:
    """The gap is between the nearest centres of two arrays, in their pitch."""
    rng = np.random.default_rng(7)
    for _ in range(60):
        codes = [int(c) for c in rng.integers(8, size=2)]
        left = printed_array(codes[0], (-(1 + gap) / 2 * PITCH_M, 0.0))
        right = printed_array(codes[1], ((1 + gap) / 2 * PITCH_M, float(rng.choice([0, 0.5, 1])) * PITCH_M))
        pose = facing_wall(rng.uniform(0.6, 3), rng.uniform(0, 45), rng.uniform(0, 360), rng.uniform(0, 360))
        seen, shapes = detections(left + right, pose, rng, center_noise=0.01, size_noise=0.04)
        for affinity in (None, shapes):
            for array in decode_arrays(seen, affinity=affinity):
                if array.code is not None:
                    own = {d.id // 3 for d in array.detections}
                    assert len(own) == 1
                    assert array.code == codes[own.pop()]


def test_arrays_at_one_and_a_half_pitch_are_read() -> None:
    left, right = printed_array(1, (-1.25 * PITCH_M, 0.0)), printed_array(6, (1.25 * PITCH_M, 0.0))
    seen, _ = detections(left + right, facing_wall(1.0, 35, 45, 10))
    assert [a.code for a in decode_arrays(seen)] == [1, 6]


def wallpaper(rng: np.random.Generator, columns: int, rows: int, pitch_m: float) -> list[Printed]:
    """Return a grid of markers of random polarity."""
    centers = [(x * pitch_m, y * pitch_m) for x in range(columns) for y in range(rows)]
    middle = np.mean(centers, axis=0)
    return [Printed((x - middle[0], y - middle[1]), "light" if rng.random() < 0.5 else "dark") for x, y in centers]


@pytest.mark.parametrize("pitch", [1.1, 1.5])
def test_a_dense_wall_of_markers_is_no_array(pitch: float) -> None:
    rng = np.random.default_rng(4)
    wall = wallpaper(rng, 9, 7, pitch * SIDE_M)
    for tilt in (0, 25, 45):
        seen, shapes = detections(wall, facing_wall(1.2, tilt, 35, 12))
        assert all(a.code is None for a in decode_arrays(seen))
        assert all(a.code is None for a in decode_arrays(seen, affinity=shapes))


def test_a_hole_in_a_dense_wall_is_no_array() -> None:
    """Missing markers make blanks; what is around them still tells."""
    rng = np.random.default_rng(8)
    for _ in range(50):
        kept = [p for p in wallpaper(rng, 7, 5, PITCH_M) if rng.random() > 0.1]
        seen, _ = detections(kept, facing_wall(1.5, rng.uniform(0, 40), rng.uniform(0, 360), rng.uniform(0, 360)))
        assert all(a.code is None for a in decode_arrays(seen))


LAYOUTS = [
    Layout(2, 3),
    Layout(3, 3),
    Layout(3, 4, parity=True),
    Layout(4, 2, pitch=1.25, parity=True),
    Layout(5, 5, pitch=2.0),
]


@pytest.mark.parametrize("layout", LAYOUTS, ids=str)
def test_larger_arrays_by_the_same_code(layout: Layout) -> None:
    rng = np.random.default_rng(9)
    for _ in range(20):
        code = int(rng.integers(2**layout.bits))
        pose = facing_wall(rng.uniform(0.9, 3), rng.uniform(0, 45), rng.uniform(0, 360), rng.uniform(0, 360))
        seen, shapes = detections(printed_array(code, layout=layout), pose, rng, center_noise=0.01, size_noise=0.03)
        order = rng.permutation(len(seen))
        for affinity in (None, shapes[order]):
            (found,) = decode_arrays([seen[i] for i in order], layout, affinity=affinity)
            assert found.code == code
            assert [d.id for d in found.detections] == list(range(len(seen)))


def test_a_larger_array_with_a_missing_marker_is_unsure() -> None:
    layout = Layout(3, 3)
    for missing in range(8):
        printed = printed_array(77, layout=layout)
        del printed[missing]
        seen, _ = detections(printed, facing_wall(1.0, 20, 0, 130))
        assert all(a.code is None for a in decode_arrays(seen, layout))


def test_parity_turns_a_misread_marker_into_doubt() -> None:
    layout = Layout(3, 3, parity=True)
    printed = printed_array(45, layout=layout)
    for wrong in range(8):
        other: Polarity = "light" if printed[wrong].polarity == "dark" else "dark"
        changed = [*printed[:wrong], Printed(printed[wrong].xy_m, other), *printed[wrong + 1 :]]
        seen, _ = detections(changed, facing_wall(1.0, 20, 0, 130))
        assert [(a.code, a.doubt) for a in decode_arrays(seen, layout)] == [(None, "parity is wrong")]


def test_a_shape_that_could_not_be_measured_is_replaced_by_the_size() -> None:
    seen, shapes = detections(printed_array(2), facing_wall(1.0, 30, 0, 0))
    for bad in (np.nan, 0.0):
        shapes[1] = bad
        assert [a.code for a in decode_arrays(seen, affinity=shapes)] == [2]


@given(CODES, st.floats(0.5, 4), st.floats(0, 20), st.floats(-15, 15))
def test_the_paper_s_rule_reads_upright_arrays(code: int, distance: float, tilt: float, roll: float) -> None:
    seen, _ = detections(printed_array(code), facing_wall(distance, tilt, 0, roll))
    (found,) = decode_arrays(seen, rule="paper")
    assert found.code == code
    assert [d.polarity for d in found.detections] == list(polarities_of(code))


def test_the_paper_s_rule_misreads_a_rolled_array_where_the_robust_one_does_not() -> None:
    misread = 0
    for roll in range(10, 370, 20):
        views = [detections(printed_array(code), facing_wall(1.0, 0, 0, roll))[0] for code in range(8)]
        misread += [decode_arrays(seen, rule="paper")[0].code for seen in views] != list(range(8))
        assert [decode_arrays(seen)[0].code for seen in views] == list(range(8))
    assert misread >= 9


def test_bad_input() -> None:
    seen, shapes = detections(printed_array(2), facing_wall(1.0, 30, 0, 0))
    with pytest.raises(InputError, match="rule"):
        decode_arrays(seen, rule="best")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="2×2"):
        decode_arrays(seen, Layout(3, 3), rule="paper")
    with pytest.raises(InputError, match=r"affinity: expected \(3, 2, 2\), got \(2, 2, 2\)"):
        decode_arrays(seen, affinity=shapes[:2])
