"""Pieces of the exact arithmetic, each against its definition."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from peakmark.surf.exact import filter_response, mask_accepts, newton_offset
from peakmark.surf.integral import integral_image
from peakmark.surf.layers import Layer
from tests.peakmark.surf.reference import layer_response, newton_step
from tests.samples import speckled


@pytest.mark.parametrize("layer", [Layer(0, 0), Layer(0, 3), Layer(1, 1), Layer(2, 2), Layer(3, 0)], ids=str)
def test_responses_at_single_positions_are_those_of_the_layer(layer: Layer) -> None:
    gray = speckled(110, 120, 1)
    integral = integral_image(gray)
    plain = layer_response(integral, layer)
    rows, columns = layer.positions(*gray.shape)
    for i, j in ((0, 0), (rows - 1, columns - 1), (rows // 2, columns // 3)):
        found = filter_response(integral, i * layer.step, j * layer.step, layer.side)
        det = plain.det[i + layer.offset, j + layer.offset]
        assert found.determinant == det
        dxx, dyy, dxy = found.derivatives
        assert dxx + dyy == plain.trace[i + layer.offset, j + layer.offset]
        assert abs(found.quick - det) <= 2.0**-12 * (abs(dxx * dyy) + dxy * dxy)


@given(
    center=st.tuples(*[st.floats(-0.9, 0.9)] * 3),
    curvature=st.tuples(*[st.floats(0.5, 5)] * 3),
    mixed=st.tuples(*[st.floats(-0.2, 0.2)] * 3),
)
def test_newton_finds_the_top_of_a_parabola(
    center: tuple[float, ...], curvature: tuple[float, ...], mixed: tuple[float, ...]
) -> None:
    assume(max(abs(c) for c in center) > 1e-3)
    hessian = -np.diag(curvature)
    for (i, j), value in zip(((0, 1), (0, 2), (1, 2)), mixed, strict=True):
        hessian[i, j] = hessian[j, i] = value
    s, y, x = np.mgrid[-1:2, -1:2, -1:2]
    offset = np.stack([x, y, s]).reshape(3, -1) - np.array(center)[:, None]
    cube = (100 + 0.5 * np.einsum("ik,ij,jk->k", offset, hessian, offset)).reshape(3, 3, 3)
    np.testing.assert_allclose(newton_step(cube), center, atol=1e-9)
    ok, step = newton_offset(cube.astype(np.float32))
    assert ok
    np.testing.assert_allclose(step, center, atol=1e-3)


@pytest.mark.parametrize(
    ("edit", "why"),
    [
        (lambda cube: cube * 0, "singular"),
        (lambda cube: np.abs(np.mgrid[-1:2, -1:2, -1:2]).sum(axis=0) * -1.0, "the middle is the exact top"),
        (lambda cube: cube + 3.0 * np.mgrid[-1:2, -1:2, -1:2][2], "the top is more than a step away"),
    ],
)
def test_newton_refuses(edit, why: str) -> None:  # type: ignore[no-untyped-def]
    s, y, x = np.mgrid[-1:2, -1:2, -1:2]
    cube = edit(-(s**2 + y**2 + x**2).astype(np.float64))
    assert not newton_offset(cube.astype(np.float32))[0], why


@given(st.integers(0, 81))
def test_half_of_the_square_is_enough_for_the_mask(covered: int) -> None:
    mask = (np.arange(81) < covered).reshape(9, 9).astype(np.uint8)
    assert mask_accepts(integral_image(mask), 0, 0, 9) == (covered >= 40.5)
