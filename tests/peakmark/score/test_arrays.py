"""Arrays against truth: what the shipped room prints, and readings that are right, wrong, cut, hidden or too steep."""

from dataclasses import replace

import numpy as np
import pytest
from peaksim import load_scene
from peaksim.camera.frame import MarkerTruth
from peaksim.camera.shutter import still_camera
from peaksim.geometry.pose import invert, transform
from peaksim.scene.scene import Scene
from peaksim.truth.markers import marker_truth

from peakmark.arrays.decode import MarkerArray
from peakmark.identification.detection import Detection
from peakmark.markers.array_code import THREE_BIT, polarities_of
from peakmark.score.arrays import ArrayScore, PrintedArray, printed_arrays, score_arrays
from peakmark.score.wanted import polarity_of

CAVE = load_scene("cave")
PRINTED = printed_arrays(CAVE.scene)
POSE = CAVE.trajectory.at(0.0)
TRUTH = marker_truth(CAVE.scene, still_camera(CAVE.camera, POSE))


def reading(printed: PrintedArray, code: int | None, shift_px: float = 0.0) -> MarkerArray:
    records = {t.name: t for t in TRUTH}
    found = tuple(
        Detection(k, records[name].center_xy + np.array([shift_px, 0]), records[name].side_px, "dark", 1e4, 0.1, k + 1)
        for k, name in enumerate(printed.marks)
    )
    return MarkerArray(code, "" if code is not None else "doubt", found, THREE_BIT)


def score(arrays: list[MarkerArray], truth: tuple[MarkerTruth, ...] = TRUTH) -> ArrayScore:
    return score_arrays(PRINTED, truth, arrays, CAVE.camera, POSE)


def named(name: str) -> PrintedArray:
    return next(p for p in PRINTED if p.name == name)


def test_the_shipped_room_prints_each_code_once() -> None:
    assert sorted(p.code for p in PRINTED) == list(range(8))
    assert all(p.name == f"array{p.code}" for p in PRINTED)
    kinds = {t.name: t.kind for t in TRUTH}
    for p in PRINTED:
        assert tuple(polarity_of(kinds[name]) for name in p.marks) == polarities_of(p.code)


def test_centres_axes_and_corners_agree_with_the_truth() -> None:
    records = {t.name: t for t in TRUTH}
    for name in ("array3", "array5"):
        p = named(name)
        xy = CAVE.camera.project(transform(invert(POSE), p.place.centers_m))
        assert np.allclose(xy, [records[m].center_xy for m in p.marks], atol=1e-6)
        corner, right, down = p.corners_m[0], p.corners_m[1] - p.corners_m[0], p.corners_m[3] - p.corners_m[0]
        reach = (THREE_BIT.pitch + 1) * p.place.side_m
        assert np.allclose(right, reach * p.place.axes[:, 0], atol=1e-9)
        assert np.allclose(down, reach * p.place.axes[:, 1], atol=1e-9)
        assert np.linalg.norm(corner - p.place.centers_m[0]) > np.linalg.norm(corner + right - p.place.centers_m[0])


def test_other_posters_are_no_arrays() -> None:
    quads = [q for q in CAVE.scene.quads if not q.name.startswith("array")]
    assert printed_arrays(Scene(tuple(quads))) == ()


def test_right_wrong_unsure_and_missed() -> None:
    assert score([]).missed == ("array3", "array5")
    result = score([reading(named("array3"), 3), reading(named("array5"), 4), reading(named("array5"), None)])
    assert (result.in_view, result.decoded, result.missed) == (("array3", "array5"), ("array3",), ("array5",))
    assert (result.wrong, result.unsure, result.right) == (1, 1, {"array3": 0})


@pytest.mark.parametrize(("shift", "wrong"), [(0.2, 0), (0.3, 1)])
def test_a_right_code_at_a_wrong_position_is_wrong(shift: float, wrong: int) -> None:
    side = next(t.side_px for t in TRUTH if t.name.startswith("array3."))
    assert score([reading(named("array3"), 3, shift * side)]).wrong == wrong


def test_a_code_read_twice_counts_once() -> None:
    assert score([reading(named("array3"), 3), reading(named("array3"), 3)]).wrong == 1


@pytest.mark.parametrize("change", [{"visible_fraction": 0.9}, {"side_px": 19.0}, {"tilt_deg": 46.0}])
def test_hidden_small_and_steep_arrays_need_not_be_read(change: dict[str, float]) -> None:
    truth = tuple(replace(t, **change) if t.name == "array3.r0c1" else t for t in TRUTH)  # type: ignore[arg-type]
    assert score([], truth).in_view == ("array5",)
    assert score([reading(named("array3"), 3)], truth).wrong == 0


def test_an_array_whose_blank_corner_the_border_cuts_need_not_be_read() -> None:
    (x, y) = CAVE.camera.project(transform(invert(POSE), named("array3").corners_m))[0]
    camera = replace(CAVE.camera, cx=CAVE.camera.cx - x - 1)
    shifted = tuple(replace(t, center_xy=t.center_xy - [x + 1, 0]) for t in TRUTH)
    result = score_arrays(PRINTED, shifted, [], camera, POSE)
    assert "array3" not in result.in_view
    assert 0 < y < camera.height
