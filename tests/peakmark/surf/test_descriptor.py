"""Descriptors against the plain operator, and what must hold of any."""

import numpy as np
import pytest

from peakmark import surf
from peakmark.errors import InputError
from peakmark.keypoints.keypoints import Keypoints
from peakmark.surf.descriptor import window_side
from tests.peakmark.surf import reference
from tests.samples import some_keypoints, speckled

GRAY = speckled(160, 200, 8)


@pytest.mark.parametrize(("extended", "worst"), [(False, 0.01), (True, 0.06)])
def test_kernel_agrees_with_the_plain_operator(extended: bool, worst: float) -> None:
    keypoints = surf.detect(GRAY, threshold=30)
    found = surf.describe(GRAY, keypoints, extended=extended)
    rows = zip(keypoints.xy.tolist(), keypoints.size.tolist(), keypoints.angle.tolist(), strict=True)
    plain = np.array([reference.descriptor(GRAY, x, y, size, angle, extended) for (x, y), size, angle in rows])
    apart = np.linalg.norm(found - plain, axis=1)
    assert len(keypoints) > 100
    assert np.median(apart) < 1e-6
    assert np.quantile(apart, 0.9) < worst  # rounding half a grey level the other way can change a gradient's sign


def test_descriptors_have_unit_length_and_a_uniform_window_zero() -> None:
    gray = np.full((120, 200), 50, np.uint8)
    gray[:, 100:] = GRAY[:120, 100:]
    keypoints = some_keypoints(3).with_columns(
        xy=np.array([[40, 60], [160, 60], [150, 70]], np.float32), size=np.array([12, 12, 9], np.float32)
    )
    for extended in (False, True):
        lengths = np.linalg.norm(surf.describe(gray, keypoints, extended), axis=1)
        np.testing.assert_allclose(lengths, [0, 1, 1], atol=1e-5)


def test_the_128_entries_split_the_64() -> None:
    keypoints = surf.detect(GRAY, threshold=100)
    cells = surf.describe(GRAY, keypoints).reshape(-1, 16, 4)
    split = surf.describe(GRAY, keypoints, extended=True).reshape(-1, 16, 8)
    joined = np.stack(
        [
            split[..., 0] + split[..., 2],
            split[..., 4] + split[..., 6],
            split[..., 1] + split[..., 3],
            split[..., 5] + split[..., 7],
        ],
        axis=2,
    )
    joined /= np.linalg.norm(joined.reshape(len(joined), -1), axis=1)[:, None, None]
    np.testing.assert_allclose(joined, cells, atol=1e-5)


def test_rotating_the_image_by_90_degrees_changes_nothing_but_the_angle() -> None:
    keypoints = surf.detect(GRAY, threshold=200)
    rotated = keypoints.with_columns(
        xy=np.stack([keypoints.xy[:, 1], GRAY.shape[1] - 1 - keypoints.xy[:, 0]], axis=1),
        angle=(keypoints.angle + 270) % 360,
    )
    apart = surf.describe(np.rot90(GRAY), rotated) - surf.describe(GRAY, keypoints)
    assert np.quantile(np.linalg.norm(apart, axis=1), 0.9) < 0.02


def test_window_sides_are_truncated() -> None:
    sizes = np.array([9, 15, 21, 27, 30], np.float32)
    assert window_side(sizes).tolist() == [25, 42, 58, 75, 84]


def test_key_points_of_others_are_described_down_to_one_pixel() -> None:
    tiny = some_keypoints(2).with_columns(
        xy=np.array([[50, 50], [0, 0]], np.float32), size=np.array([0.36, 5], np.float32)
    )
    assert surf.describe(GRAY, tiny).shape == (2, 64)
    assert surf.describe(GRAY, Keypoints.empty(), extended=True).shape == (0, 128)


@pytest.mark.parametrize(
    ("column", "value"),
    [("size", 0.1), ("size", np.nan), ("size", 1e9), ("xy", np.nan), ("xy", np.inf), ("angle", np.nan)],
)
def test_key_points_that_cannot_be_described_are_named(column: str, value: float) -> None:
    keypoints = some_keypoints(2)
    keypoints.columns()[column][0] = value
    with pytest.raises(InputError, match=rf"keypoints\.{column}.*expected.*got"):
        surf.describe(GRAY, keypoints)
