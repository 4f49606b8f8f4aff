"""The first stages alone against the plain operators, on whole layers."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from peakmark import surf
from tests.peakmark.surf import reference
from tests.samples import speckled

sizes = st.integers(1, 150)


@given(height=sizes, width=sizes, seed=st.integers(0, 10**6), octaves=st.integers(1, 5), layers=st.integers(1, 5))
def test_layers_and_maxima_are_those_of_the_definition(
    height: int, width: int, seed: int, octaves: int, layers: int
) -> None:
    integral = surf.integral_image(speckled(height, width, seed))
    responses = surf.hessian_responses(integral, octaves, layers)
    plain = reference.hessian_responses(integral, octaves, layers)
    for ours, theirs in zip(responses, plain, strict=True):
        assert ours.layer == theirs.layer
        np.testing.assert_array_equal(ours.det, theirs.det)
        np.testing.assert_array_equal(ours.trace, theirs.trace)
    found, expected = surf.interest_points(responses, 30.0), reference.interest_points(plain, 30.0)
    for name in ("size", "response", "octave", "laplacian", "angle"):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name), err_msg=name)
    np.testing.assert_allclose(found.xy, expected.xy, atol=2e-3)
    np.testing.assert_allclose(found.scale, expected.scale, atol=1e-2)
