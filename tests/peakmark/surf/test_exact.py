"""Pieces of the exact arithmetic, each against its definition."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from peakmark.surf import exact as surf_exact
from peakmark.surf.integral import integral_image
from peakmark.surf.layers import Layer
from tests.compiled import callable_part
from tests.peakmark.surf.reference import layer_response, newton_step
from tests.samples import speckled

exact_derivatives = callable_part(surf_exact.exact_derivatives)
exact_response = callable_part(surf_exact.exact_response)
quick_response = callable_part(surf_exact.quick_response)
newton_offset = callable_part(surf_exact.newton_offset)
mask_accepts = callable_part(surf_exact.mask_accepts)


@pytest.mark.parametrize("layer", [Layer(0, 0), Layer(0, 3), Layer(1, 1), Layer(2, 2), Layer(3, 0)], ids=str)
def test_responses_at_single_positions_are_those_of_the_layer(layer: Layer) -> None:
    gray = speckled(110, 120, 1)
    integral = integral_image(gray)
    plain = layer_response(integral, layer)
    sums, stride = np.ascontiguousarray(integral).reshape(-1), integral.shape[1]
    rows, columns = layer.positions(*gray.shape)
    for i, j in ((0, 0), (rows - 1, columns - 1), (rows // 2, columns // 3)):
        corner = i * layer.step * stride + j * layer.step
        det = plain.det[i + layer.offset, j + layer.offset]
        assert exact_response(sums, stride, corner, layer.side) == det
        dxx, dyy, dxy = exact_derivatives(sums, stride, corner, layer.side)
        assert np.float32(dxx) + np.float32(dyy) == plain.trace[i + layer.offset, j + layer.offset]
        doubt = 2.0**-12 * (abs(dxx * dyy) + dxy * dxy)
        assert abs(quick_response(sums, stride, corner, layer.side) - det) <= doubt


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
    ok, *step = newton_offset(cube.astype(np.float32))
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
    sums = np.ascontiguousarray(integral_image(mask)).reshape(-1)
    assert mask_accepts(sums, 10, 0, 9) == (covered >= 40.5)
