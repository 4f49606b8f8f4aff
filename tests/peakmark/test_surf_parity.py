"""SURF against OpenCV's own key points on seven images × three settings; run with -s to see the worst cases."""

import numpy as np
import pytest
from surf_parity import IMAGES, SETTINGS, compare, load_expected, load_image, load_parameters

from peakmark import surf


@pytest.mark.parametrize("setting", SETTINGS)
@pytest.mark.parametrize("name", IMAGES)
def test_key_points_are_opencvs(name: str, setting: str) -> None:
    expected = load_expected(name, setting)
    parity = compare(expected, surf.detect_and_describe(load_image(name), **load_parameters(name, setting)))
    print("\n" + parity.row(f"{name}.{setting}"))

    assert parity.theirs == parity.ours == len(parity.pairs)
    assert parity.same_order
    assert parity.response_relative.max(initial=0) <= 1e-7
    if len(parity.pairs):
        assert np.quantile(parity.angle_deg, 0.995) <= 0.1
        assert np.quantile(parity.descriptor, 0.95) <= 0.02
        assert np.median(parity.descriptor) <= 0.005
