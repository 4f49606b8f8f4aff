"""SURF against OpenCV's own key points on seven images × three settings; run with -s to see the worst cases."""

import numpy as np
import pytest

from peakmark import surf
from peakmark.keypoints.keypoints import Keypoints
from tests.peakmark.surf.parity import IMAGES, SETTINGS, compare, load_expected, load_image, load_parameters


@pytest.mark.parametrize("setting", SETTINGS)
@pytest.mark.parametrize("name", IMAGES)
def test_key_points_are_opencvs(name: str, setting: str) -> None:
    expected = load_expected(name, setting)
    ours = surf.detect_and_describe(load_image(name), **load_parameters(name, setting))
    parity = compare(expected, ours)
    print("\n" + parity.row(f"{name}.{setting}"))

    assert parity.theirs == parity.ours == len(parity.pairs)
    assert parity.same_order
    np.testing.assert_array_equal(ours.response, expected.response)
    assert parity.shift_px.max(initial=0) <= 0.005
    assert parity.angle_deg.max(initial=0) <= 0.01
    assert parity.descriptor.max(initial=0) <= 0.02
    assert np.median(np.append(parity.descriptor, 0)) <= 0.001


def test_the_comparison_sees_what_differs() -> None:
    expected = load_expected("coins", "default")
    moved = expected.with_columns(xy=expected.xy + np.float32(0.02))
    assert len(compare(expected, moved).pairs) < 10
    assert len(compare(expected, expected[1:]).pairs) == len(expected) - 1
    assert not compare(expected, expected[::-1]).same_order
    other = expected.with_columns(laplacian=-expected.laplacian)
    assert len(compare(expected, other).pairs) == 0
    rotated = expected.with_columns(angle=(expected.angle + 359) % 360, response=expected.response * np.float32(1.5))
    parity = compare(expected, rotated)
    assert parity.angle_deg.max() == pytest.approx(1, abs=1e-3)
    assert parity.response_relative.min() == pytest.approx(1 / 3, abs=1e-3)
    assert len(compare(expected, Keypoints.empty(64)).pairs) == 0
