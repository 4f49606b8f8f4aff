"""Extremes of the DoG: the kernel against a plain search, and places between pixels."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, maximum_filter

from peakmark.identification.sift_candidates import LEAST_RESPONSE, _dog_extremes, dog_extremes
from peakmark.markers.patterns import Variant, marker_image


def blurred_noise() -> NDArray[np.float32]:
    noise = np.random.default_rng(0).random((161, 203))
    return np.array([gaussian_filter(noise, 0.8 * 1.26**k) for k in range(6)], dtype=np.float32)


def extremes(blurs: NDArray[np.float32], room: int) -> tuple[NDArray[np.int32], int]:
    rows, count = np.empty((room, 4), np.int32), np.empty(1, np.int64)
    _dog_extremes(blurs, LEAST_RESPONSE, rows, count)
    return rows, int(count[0])


def test_the_kernel_lists_what_a_plain_search_does() -> None:
    blurs = blurred_noise()
    rows, count = extremes(blurs, 9999)
    dogs, expected = np.diff(blurs, axis=0), set()
    for sign in (1, -1):
        largest = maximum_filter(sign * dogs, size=3, mode="constant", cval=-1)
        is_extreme = (sign * dogs >= largest) & (sign * dogs > np.float32(LEAST_RESPONSE))
        expected |= {(*map(int, at), sign) for at in np.argwhere(is_extreme) if 0 < at[0] < len(dogs) - 1}
    assert len(expected) > 20
    assert {tuple(map(int, row)) for row in rows[:count]} == expected


def test_all_are_counted_where_there_is_room_for_few() -> None:
    blurs = blurred_noise()
    (few, count), (all_rows, again) = (extremes(blurs, room) for room in (3, 9999))
    assert count == again > 3
    assert np.array_equal(few, all_rows[:3])


@pytest.mark.parametrize("side", [40, 61, 120, 201])
def test_a_place_is_told_between_pixels(side: int) -> None:
    image = np.pad(marker_image(side, Variant("dark", "energy", "sift")), 60, mode="edge")
    x, y, _, _ = max(dog_extremes(image).tolist(), key=lambda row: abs(row[3]))
    middle = (len(image) - 1) / 2
    assert np.hypot(x - middle, y - middle) < 0.15
