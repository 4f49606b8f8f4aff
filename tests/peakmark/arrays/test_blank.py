"""The blank corner must be bare paper: a block of four of which one was missed is not read."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from peakmark import decode_arrays, identify
from peakmark.arrays.look import Print
from peakmark.markers.optimum import Limit
from peakmark.markers.patterns import Polarity, Variant, marker_image, surf_marker
from tests.peakmark.arrays import rendered
from tests.peakmark.arrays.arrays_scene import facing_wall
from tests.peakmark.identification.walls import TEXELS, sheet, wall


def block(code: int, fourth: Polarity) -> np.ndarray:
    paper = sheet(code)
    left = int(2 * TEXELS - 0.75 * TEXELS - TEXELS / 2)
    paper[left : left + TEXELS, left : left + TEXELS] = surf_marker(TEXELS, fourth)
    return paper


@pytest.mark.parametrize("fourth", ["dark", "light"])
@pytest.mark.parametrize("rotation_deg", [0, 70, 200])
def test_a_block_with_a_missed_marker_is_unsure_where_the_image_is_given(fourth: Polarity, rotation_deg: float) -> None:
    image = wall([(block(2, fourth), 240, 180, 40, rotation_deg)])
    found = identify(image, polarity="both")
    assert len(found) == 4
    angle = np.radians(rotation_deg)
    corner = np.array([240, 180]) - 30 * np.array([np.cos(angle) + np.sin(angle), np.cos(angle) - np.sin(angle)])
    three = [d for d in found if np.linalg.norm(d.xy - corner) > 5]
    assert [a.code for a in decode_arrays(three)] == [2]
    assert decode_arrays(three, image=image) == ()  # the fourth is seen
    (array,) = decode_arrays([replace(d, affinity=None) for d in three], image=image)  # nothing tells where to look
    assert (array.code, array.doubt) == (None, "the blank corner is not blank")


@pytest.mark.parametrize("fourth", ["dark", "light"])
@pytest.mark.parametrize("limit", ["energy", "range"])
@pytest.mark.parametrize("distance", [0.6, 1.3])
def test_a_missed_round_marker_is_not_paper(distance: float, limit: Limit, fourth: Polarity) -> None:
    printed, pose = Print("sift", limit), facing_wall(distance, 30, 50, 20)
    bare = rendered.paper(2, printed=printed)
    full, left = bare.copy(), round(0.75 * rendered.TEXELS)
    marker = marker_image(rendered.TEXELS, Variant(fourth, limit, "sift"))
    full[left : left + len(marker), left : left + len(marker)] = marker
    three = rendered.true_detections(2, pose, printed=printed)
    assert [a.code for a in decode_arrays(three, image=rendered.view(bare, pose))] == [2]
    assert all(a.code is None for a in decode_arrays(three, image=rendered.view(full, pose)))


@pytest.mark.parametrize("level", [0, 90, 150])
def test_something_in_front_of_the_corner_is_not_paper(level: int) -> None:
    image = wall([(sheet(6), 240, 180, 40, 0)])
    hidden = image.copy()
    hidden[100:168, 150:230] = level
    assert [a.code for a in decode_arrays(identify(image, polarity="both"), image=image)] == [6]
    assert [a.code for a in decode_arrays(identify(hidden, polarity="both"), image=hidden)] in ([], [None])


@pytest.mark.parametrize("white", [180, 255])
def test_paper_may_be_a_little_darker_than_the_pattern_s_white(white: int) -> None:
    for code in range(8):
        image = wall([(sheet(code, max(white, 215)), 240, 180, 25, 30)], seed=code)
        image = (image * (white / 255)).astype(np.uint8)
        assert [a.code for a in decode_arrays(identify(image, polarity="both"), image=image)] == [code]


@pytest.mark.parametrize("code", range(8))
@pytest.mark.parametrize("side", [21, 30, 57.6])
def test_bare_paper_is_blank_whatever_the_markers_beside_it(code: int, side: float) -> None:
    size = round(4 * side)
    image = cv2.resize(sheet(code), (size, size), interpolation=cv2.INTER_AREA)
    image = cv2.GaussianBlur(np.pad(image, 40, constant_values=255), (0, 0), 0.7)
    assert [a.code for a in decode_arrays(identify(image, polarity="both"), image=image)] == [code]


def test_the_image_tells_its_size() -> None:
    image = wall([(sheet(3), 240, 180, 40, 0)])
    cut = image[170:, 225:]
    found = identify(cut, polarity="both")
    assert decode_arrays(found, image=cut) == ()
