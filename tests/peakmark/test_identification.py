"""The paper's rule: stretch, rank, drop, signature; duplicates and ghosts never become markers."""

import cv2
import numpy as np
import pytest
from helpers import marker_view

from peakmark.errors import InputError
from peakmark.identification import above_drop, identify, stretched, stretched_features, unstretched
from peakmark.keypoints import Keypoints


def floor_with_markers(centers: list[tuple[int, int]], side_px: int = 45) -> np.ndarray:
    """Return a low-contrast photograph with upright dark markers on white tiles pasted at whole pixels."""
    photo = cv2.imread("assets/textures/gravel.png", cv2.IMREAD_GRAYSCALE)
    picture = np.rint(150 + 0.5 * (photo.astype(float) - photo.mean())).astype(np.uint8)
    half = side_px * 5 // 8
    tile = marker_view(side_px, image_px=2 * half + 1)
    for x, y in centers:
        picture[y - half : y + half + 1, x - half : x + half + 1] = tile
    return picture


def test_all_markers_and_nothing_else_strongest_first() -> None:
    centers = [(80, 90), (200, 120), (330, 100), (140, 300), (400, 380)]
    found = identify(floor_with_markers(centers), stretch=1.0)
    assert len(found) == len(centers)
    assert {min(centers, key=lambda c: float(np.hypot(*(d.xy - c)))) for d in found} == set(centers)
    assert max(min(np.hypot(*(d.xy - c)) for c in centers) for d in found) < 1.0
    responses = [d.response for d in found]
    assert responses == sorted(responses, reverse=True)
    assert [d.id for d in found] == list(range(5))
    assert all(d.polarity == "dark" and abs(d.size - 45) < 8 for d in found)


def test_light_markers_are_those_of_the_negative() -> None:
    picture = floor_with_markers([(80, 90), (330, 300)])
    assert identify(255 - picture, stretch=1.0, polarity="dark") == ()
    dark, light = identify(picture, stretch=1.0), identify(255 - picture, stretch=1.0, polarity="light")
    assert np.allclose([d.xy for d in dark], [d.xy for d in light], atol=0.02)


def test_a_plain_picture_has_no_markers() -> None:
    assert identify(np.full((300, 400), 77, np.uint8)) == ()


def test_stretching_finds_a_squashed_marker_where_it_is() -> None:
    tall = floor_with_markers([(150, 200), (380, 300)])
    flat = cv2.resize(tall, None, fx=1, fy=0.5, interpolation=cv2.INTER_AREA)
    found = sorted(identify(flat, stretch=2.0), key=lambda d: float(d.xy[0]))
    expected = np.array([[150, (200.5 / 2) - 0.5], [380, (300.5 / 2) - 0.5]])
    assert np.allclose([d.xy for d in found], expected, atol=0.6)
    assert all(abs(d.size - 45 / np.sqrt(2)) < 6 for d in found)


def test_features_are_mapped_back_through_the_stretch() -> None:
    points = Keypoints([[10, 4.5], [0, -0.5]], [20, 20], [0, 0], [2, 1], [0, 0], [1, 1], [20, 20])  # type: ignore[arg-type]
    back = unstretched(points, 2.0)
    assert np.allclose(back.xy, [[10, 2.0], [0, -0.5]])
    assert np.allclose(back.size, 20 / np.sqrt(2))


def test_stretched_rows_are_where_the_mapping_says() -> None:
    ramp = np.repeat(np.arange(0, 200, 2, dtype=np.uint8)[:, None], 8, axis=1)
    tall = stretched(ramp, 2.0)
    rows = np.arange(2, 198)
    assert np.abs(tall[rows, 3] - 2 * ((rows + 0.5) / 2 - 0.5)).max() <= 0.5


@pytest.mark.parametrize(
    ("responses", "count"), [([], 0), ([5], 1), ([9, 8, 7, 2, 1.9], 3), ([9, 8, 7, 6.5], 0), ([100, 10, 9, 8], 1)]
)
def test_the_largest_drop_separates(responses: list[float], count: int) -> None:
    assert above_drop(np.array(responses, dtype=np.float32)) == count


@pytest.mark.parametrize("stretch", [0.0, -1.0, float("nan"), 9.0])
def test_a_senseless_stretch_is_refused(stretch: float) -> None:
    with pytest.raises(InputError, match=r"stretch: expected 0\.25…8"):
        stretched_features(np.zeros((20, 20), np.uint8), stretch)
