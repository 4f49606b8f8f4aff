"""The detector as a caller meets it: images of every kind, parameters, masks, presets, threads."""

from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from peakmark import surf
from peakmark.errors import InputError
from peakmark.parallel import threads
from tests.peakmark.surf.parity import compare, load_expected, load_image
from tests.samples import assert_equal, speckled

GRAY = speckled(120, 160, 3)
FOUND = surf.detect_and_describe(GRAY)


def chessboard(shape: tuple[int, ...]) -> np.ndarray:
    rows, columns = np.indices(shape)
    return (rows // 32 + columns // 32) % 2 == 0


@pytest.mark.parametrize("kind", [bool, np.uint8])
def test_a_mask_has_opencvs_meaning(kind: type) -> None:
    gray, expected = load_image("coins"), load_expected("coins", "masked")
    parity = compare(expected, surf.detect_and_describe(gray, mask=chessboard(gray.shape).astype(kind)))
    assert parity.theirs == parity.ours == len(parity.pairs) == 391
    assert parity.same_order


@pytest.mark.parametrize(
    "same",
    [
        np.asfortranarray(GRAY),
        GRAY[::-1][::-1],
        np.repeat(GRAY, 3, axis=1)[:, ::3],
        GRAY[:, :, None],
        np.dstack([GRAY] * 3),
        np.dstack([GRAY] * 4),
        GRAY.astype(np.uint16) * 257,
        GRAY / 255,
        (GRAY / 255).astype(np.float32),
    ],
    ids=["column-major", "view", "strided", "one channel", "RGB", "RGBA", "uint16", "float64", "float32"],
)
def test_the_same_image_gives_the_same_key_points(same: np.ndarray) -> None:
    assert len(FOUND) > 20
    assert_equal(surf.detect_and_describe(same), FOUND)


def test_red_green_blue_are_weighed_in_that_order() -> None:
    rgb = np.dstack([GRAY, GRAY[::-1], GRAY[:, ::-1]])
    assert_equal(surf.detect(rgb), surf.detect(cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY)))


@settings(max_examples=25)
@given(height=st.integers(1, 70), width=st.integers(1, 70), extended=st.booleans(), seed=st.integers(0, 99))
def test_any_size_gives_rightly_shaped_results(height: int, width: int, extended: bool, seed: int) -> None:
    gray = np.random.default_rng(seed).integers(0, 256, (height, width), dtype=np.uint8)
    found = surf.detect_and_describe(gray, threshold=0.0, extended=extended)
    assert found.descriptors is not None
    assert found.descriptors.shape == (len(found), 128 if extended else 64)
    assert ((found.xy >= 0) & (found.xy <= (width - 1, height - 1))).all()
    assert (np.diff(found.response) <= 0).all()


def test_uniform_images_give_nothing_of_the_right_shape() -> None:
    found = surf.detect_and_describe(np.full((300, 200), 200, np.uint8), threshold=0.0)
    assert found.xy.shape == (0, 2)
    assert found.descriptors is not None
    assert found.descriptors.shape == (0, 64)


def test_sums_beyond_32_bits_do_no_harm() -> None:
    bright = np.full((3000, 3200), 255, dtype=np.uint8)  # sums to 2.4e9 > 2^31
    bright[-160:, -160:] = 255 - GRAY[:, :120].repeat(2, axis=0)[:160, :1] // 8
    bright[-120:-10, -150:-10] = GRAY[:110, :140]
    corner = bright[-400:, -400:]
    whole, part = surf.detect_and_describe(bright, octaves=2), surf.detect_and_describe(corner, octaves=2)
    assert len(part) > 20
    shifted = part.with_columns(xy=part.xy + np.float32([2800, 2600]))
    parity = compare(shifted, whole)
    assert parity.theirs == parity.ours == len(parity.pairs)
    np.testing.assert_array_equal(whole.response, part.response)


@pytest.mark.parametrize("count", [0, 1, 10, 10**6])
def test_strongest_is_the_head_of_the_list(count: int) -> None:
    assert_equal(surf.detect_and_describe(GRAY, strongest=count), FOUND[:count])


def test_presets_name_the_papers_and_opencvs_scale_space() -> None:
    assert_equal(surf.detect(GRAY, **surf.OPENCV), surf.detect(GRAY))
    sides = [15, 21, 30, 42, 60, 84, 120, 168]  # the paper's eight searched filters
    paper = surf.detect(speckled(500, 500, 1), threshold=0.0, **surf.PAPER)
    assert_equal(paper, surf.detect(speckled(500, 500, 1), threshold=0.0, octaves=4, layers=2))
    assert min(paper.size) >= sides[0] - 6
    assert max(paper.size) <= sides[-1] + 48


def test_scale_is_the_size_before_rounding() -> None:
    np.testing.assert_array_equal(FOUND.size, np.rint(FOUND.scale))
    assert (FOUND.size != FOUND.scale).any()


def test_upright_key_points_point_up() -> None:
    assert set(surf.detect(GRAY, upright=True).angle) == {270}


def test_stages_alone_give_what_they_give_together() -> None:
    integral = surf.integral_image(GRAY)
    points = surf.interest_points(surf.hessian_responses(integral))
    oriented = points.with_columns(angle=surf.orientations(integral, points))
    parity = compare(FOUND, oriented.with_columns(descriptors=surf.describe(GRAY, oriented)))
    assert parity.theirs == parity.ours == len(parity.pairs)
    assert parity.same_order
    assert parity.shift_px.max() < 1e-4
    assert parity.response_relative.max() == parity.angle_deg.max() == 0
    assert np.quantile(parity.descriptor, 0.99) < 0.001


def test_the_bytes_are_the_same_for_any_thread_count_and_run() -> None:
    gray = speckled(400, 600, 7)
    results = []
    for count in (1, 2, 3, 2):
        with threads(count):
            results.append(surf.detect_and_describe(gray))
    assert len(results[0]) > 300
    for other in results[1:]:
        assert_equal(results[0], other)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: surf.detect(GRAY.astype(np.int32)), "expected dtype uint8, uint16 or floating point, got int32"),
        (lambda: surf.detect(np.zeros((9, 9, 2), np.uint8)), r"expected shape \(H, W\).*got \(9, 9, 2\)"),
        (lambda: surf.detect(np.zeros((0, 9), np.uint8)), r"got \(0, 9\)"),
        (lambda: surf.detect(np.full((9, 9), np.nan)), "expected floating-point values in 0…1, got nan"),
        (lambda: surf.detect(GRAY * 1.0), "expected floating-point values in 0…1"),
        (lambda: surf.detect(GRAY, threshold=-1), "threshold: expected a finite number of at least 0, got -1"),
        (lambda: surf.detect(GRAY, threshold=np.nan), "threshold: expected a finite number of at least 0, got nan"),
        (lambda: surf.detect(GRAY, threshold="9"), "threshold: expected a finite number of at least 0, got '9'"),
        (lambda: surf.detect(GRAY, octaves=0), "octaves: expected an integer in 1…16, got 0"),
        (lambda: surf.detect(GRAY, layers=2.5), "layers: expected an integer in 1…64, got 2.5"),
        (lambda: surf.detect(GRAY, strongest=-1), "strongest: expected None or an integer of at least 0, got -1"),
        (lambda: surf.detect(GRAY, mask=np.ones((3, 4), bool)), r"shape \(120, 160\), got bool \(3, 4\)"),
        (lambda: surf.detect(GRAY, mask=np.ones((120, 160))), "mask: expected a bool or uint8 array"),
    ],
)
def test_bad_input_is_named(call: Callable[[], Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        call()


def test_the_patents_are_named() -> None:
    assert "8,165,401" in str(surf.__doc__)
    assert "8,670,619" in str(surf.__doc__)
