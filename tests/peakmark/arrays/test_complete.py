"""Members that a search missed are seen, what cannot be seen is named, and nothing is made up."""

from dataclasses import replace

import numpy as np
import pytest

from peakmark import decode_arrays
from peakmark.arrays.complete import CLEAR
from peakmark.arrays.look import Print, look_around
from peakmark.identification.detection import Detection
from peakmark.markers.array_code import Layout
from peakmark.markers.optimum import Limit
from tests.peakmark.arrays.arrays_scene import facing_wall
from tests.peakmark.arrays.rendered import paper, true_detections, view

POSE = facing_wall(0.6, 35, 120, 40)
MISSING = "a marker is covered or missing"


@pytest.mark.parametrize("tilt", [0, 50, 66])
@pytest.mark.parametrize("left", [(0,), (1,), (2,), (0, 1), (0, 2), (1, 2)])
def test_an_array_is_read_from_one_or_two_of_its_markers(left: tuple[int, ...], tilt: float) -> None:
    for code in (2, 5):
        pose = facing_wall(0.6, tilt, 30 * code, 100 + tilt)
        image, members = view(paper(code), pose), true_detections(code, pose)
        (array,) = decode_arrays([members[k] for k in left], image=image)
        assert (array.code, array.doubt) == (code, "")
        for k, (member, truth) in enumerate(zip(array.detections, members, strict=True)):
            assert (member.rank == 0) == (k not in left)
            assert np.linalg.norm(member.xy - truth.xy) < 0.05


@pytest.mark.parametrize("limit", ["energy", "range"])
@pytest.mark.parametrize("tilt", [0, 40, 60])
@pytest.mark.parametrize("left", [(0, 1), (0, 2), (1, 2)])
def test_an_array_of_round_markers_is_read_from_two_of_them(left: tuple[int, ...], tilt: float, limit: Limit) -> None:
    printed = Print("sift", limit)
    for code in (2, 5):
        pose = facing_wall(0.6, tilt, 30 * code, 100 + tilt)
        image, members = view(paper(code, printed=printed), pose), true_detections(code, pose, printed=printed)
        (array,) = decode_arrays([members[k] for k in left], image=image)
        assert (array.code, array.doubt) == (code, "")
        for k, (member, truth) in enumerate(zip(array.detections, members, strict=True)):
            assert (member.rank == 0, member.kind) == (k not in left, truth.kind)
            assert np.linalg.norm(member.xy - truth.xy) < 0.1


def test_one_round_marker_does_not_tell_where_others_are() -> None:
    printed = Print("sift")
    image, members = view(paper(5, printed=printed), POSE), true_detections(5, POSE, printed=printed)
    assert decode_arrays(members[:1], image=image) == ()


def test_without_the_image_nothing_is_looked_for() -> None:
    assert decode_arrays(true_detections(3, POSE)[:2]) == ()


@pytest.mark.parametrize("hidden", [0, 1, 2])
@pytest.mark.parametrize("level", [0, 130, 255])
def test_a_covered_marker_leaves_its_array_unsure(hidden: int, level: int) -> None:
    image, members = view(paper(6), POSE), true_detections(6, POSE)
    x, y = members[hidden].xy
    across, down = np.meshgrid(np.arange(image.shape[1]) - x, np.arange(image.shape[0]) - y)
    image[np.hypot(across, down) < 0.6 * members[hidden].size] = level
    rest = [m for k, m in enumerate(members) if k != hidden]
    (array,) = decode_arrays(rest, image=image)
    assert array.code is None
    if array.doubt == MISSING:
        assert {id(d) for d in array.detections} == {id(d) for d in rest}
    else:  # a disc as large as this may be taken for a marker, but not be relied on
        assert array.doubt == "a marker is unclear"


@pytest.mark.parametrize("code", [0, 7])
@pytest.mark.parametrize("edge", ["left", "top", "right", "bottom"])
def test_a_marker_of_which_an_edge_is_covered_is_read(code: int, edge: str) -> None:
    pose = facing_wall(0.6, 0, 0, 0)
    image, members = view(paper(code), pose), true_detections(code, pose)
    x, y = members[2].xy
    side = members[2].size
    across, down = np.meshgrid(np.arange(image.shape[1]) - x, np.arange(image.shape[0]) - y)
    beyond = {"left": -across, "right": across, "top": -down, "bottom": down}[edge]
    image[(beyond > 0.4 * side) & (np.hypot(across, down) < 0.72 * side)] = 110
    (array,) = decode_arrays(members[:2], image=image)
    assert (array.code, array.doubt) == (code, "")
    assert np.linalg.norm(array.detections[2].xy - members[2].xy) < 0.05 * side


@pytest.mark.parametrize("side_px", [20, 40])
@pytest.mark.parametrize("is_round", [True, False])
@pytest.mark.parametrize("reach", np.arange(0.15, 0.8, 0.1))
def test_a_blob_in_the_place_of_a_marker_is_no_clear_bit(side_px: float, is_round: bool, reach: float) -> None:
    x, y = np.meshgrid(np.arange(200) - 100 - 1.5 * side_px, np.arange(160) - 80)
    radius = np.hypot(x, y) if is_round else np.maximum(np.abs(x), np.abs(y))
    image = (255 * (1 - np.clip(reach * side_px - radius + 0.5, 0, 1))).astype(np.uint8)
    around = look_around(image, np.array([100.0, 80.0]), side_px * np.eye(2), 1.5)
    assert around[1, 0].probability < CLEAR


@pytest.mark.parametrize(("factor", "count"), [(0.8, 0), (1.0, 1), (1.2, 0)])
def test_only_markers_at_the_pitch_of_an_array_are_called_one(factor: float, count: int) -> None:
    image = np.full((200, 300), 255, np.uint8)
    shape = 30 * np.eye(2)
    pair = [
        Detection(k, np.array([100 + 45.0 * factor * k, 100.0]), 30.0, "dark", 1.0, 0.1, k + 1, shape) for k in (0, 1)
    ]
    assert [a.doubt for a in decode_arrays(pair, image=image)] == count * [MISSING]
    turned = [pair[0], replace(pair[1], affinity=30 * np.array([[0.8, -0.6], [0.6, 0.8]]))]
    assert decode_arrays(turned, image=image) == ()


def test_what_stands_in_the_way_of_a_marker_that_is_seen_goes() -> None:
    image, members = view(paper(4), POSE), true_detections(4, POSE)
    wrong = replace(members[0], xy=members[0].xy + 0.5 * members[0].size, polarity="dark")
    (array,) = decode_arrays([wrong, *members[1:]], image=image)
    assert (array.code, array.doubt) == (4, "")
    assert np.linalg.norm(array.detections[0].xy - members[0].xy) < 0.05


def test_a_full_block_is_no_array_whatever_was_found_of_it() -> None:
    sheet = paper(5)
    corner = slice(54, 126)
    sheet[corner, corner] = sheet[corner, 162:234]
    image, members = view(sheet, POSE), true_detections(5, POSE)
    assert [a.code for a in decode_arrays(members)] == [5]
    assert decode_arrays(members, image=image) == ()


def test_members_lead_to_one_another_in_a_large_array() -> None:
    layout = Layout(rows=3, columns=3, parity=True)
    pose = facing_wall(0.8, 30, 10, 20)
    image, members = view(paper(77, layout), pose), true_detections(77, pose, layout)
    (array,) = decode_arrays(members[:2], layout, image=image)
    assert (array.code, array.doubt) == (77, "")
    assert [d.rank for d in array.detections] == [1, 2, *(6 * [0])]


def test_a_misaligned_marker_of_a_readable_array_is_put_right() -> None:
    """A wrong fit of a marker, half a side off and sheared, still lies in its cell."""
    pose = facing_wall(0.6, 20, 30, 5)
    image, members = view(paper(3), pose), true_detections(3, pose)
    assert members[0].affinity is not None
    sheared = members[0].affinity @ np.array([[1.1, -0.6], [0.1, 0.8]])
    wrong = replace(members[0], xy=members[0].xy + 0.4 * members[0].affinity[:, 0], affinity=sheared)
    (array,) = decode_arrays([wrong, *members[1:]], image=image)
    assert array.code == 3
    assert np.linalg.norm(array.detections[0].xy - members[0].xy) < 0.05
