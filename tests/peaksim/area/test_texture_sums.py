"""write_sums: every node holds the sum of what is above and left of it, the border repeated once."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from peaksim.area.texture_sums import sums_shape, write_sums

SIDES = st.integers(1, 9)
SHAPES = st.one_of(st.tuples(SIDES, SIDES), st.tuples(SIDES, SIDES, st.just(3)))


@given(SHAPES.flatmap(lambda shape: arrays.arrays(np.uint8, shape)))
def test_a_node_is_the_sum_of_the_texels_above_and_left(pixels: np.ndarray) -> None:
    sums = np.full(sums_shape(pixels), np.nan)
    write_sums(pixels, sums)
    padded = np.pad(np.atleast_3d(pixels).astype(np.int64), ((1, 1), (1, 1), (0, 0)), mode="edge")
    for channel, y, x in np.ndindex(sums.shape):
        assert sums[channel, y, x] == padded[:y, :x, channel].sum()


@pytest.mark.parametrize("view", [np.s_[::2, ::3], np.s_[:, ::-1]], ids=["strided", "backwards"])
def test_pixels_may_lie_anyhow_in_memory(view: tuple[slice, slice]) -> None:
    pixels = np.random.default_rng(1).integers(0, 256, (8, 9), dtype=np.uint8)[view]
    sums, tight = np.empty(sums_shape(pixels)), np.empty(sums_shape(pixels))
    write_sums(pixels, sums)
    write_sums(pixels.copy(), tight)
    assert np.array_equal(sums, tight)
