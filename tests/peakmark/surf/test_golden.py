"""Key points in C against those that Numba's kernels gave: the same ones, to the last bit of the response."""

import numpy as np
import pytest

from tests.surf_golden import PATH, SETTINGS, measure


@pytest.mark.parametrize("setting", SETTINGS)
def test_key_points_are_the_same(setting: str) -> None:
    with np.load(PATH) as golden:
        expected = dict(golden)
    found = measure(expected["image"])
    for name in ("size", "response", "octave", "laplacian"):
        np.testing.assert_array_equal(found[f"{setting}.{name}"], expected[f"{setting}.{name}"], err_msg=name)
    for name in ("xy", "scale"):  # Numba fused multiplications with additions in the responses around a maximum
        np.testing.assert_allclose(found[f"{setting}.{name}"], expected[f"{setting}.{name}"], atol=5e-4, err_msg=name)
    angle = np.abs(found[f"{setting}.angle"] - expected[f"{setting}.angle"])
    assert np.minimum(angle, 360 - angle).max() < 1e-3
    apart = np.linalg.norm(found[f"{setting}.descriptors"] - expected[f"{setting}.descriptors"], axis=1)
    # without fused multiply-add a bilinear sample is now and then rounded to the other grey level
    assert np.median(apart) < 1e-3
    assert apart.max() < 0.02
