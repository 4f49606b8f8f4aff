import numpy as np
from scipy.ndimage import convolve1d

from peakmark.refine.align import block_means, shape_grid, softened


def test_block_means_are_means_of_whole_blocks():
    picture = np.random.default_rng(1).uniform(0, 255, (20, 31)).astype(np.float32)
    expected = picture[:18, :30].reshape(6, 3, 10, 3).mean(axis=(1, 3))
    np.testing.assert_allclose(block_means(picture, 3), expected, rtol=1e-5)


def test_softened_filters_both_axes_and_repeats_edges():
    picture = np.random.default_rng(2).uniform(0, 255, (9, 12)).astype(np.float32)
    expected = convolve1d(
        convolve1d(picture, [0.25, 0.5, 0.25], 0, mode="nearest"), [0.25, 0.5, 0.25], 1, mode="nearest"
    )
    np.testing.assert_allclose(softened(picture), expected, rtol=1e-5)


def test_shapes_cover_turns_foreshortenings_and_sizes():
    shapes = shape_grid()
    sides = np.sqrt(np.linalg.det(shapes))
    assert (sides.min(), sides.max()) == (0.75, 1.33) or np.allclose([sides.min(), sides.max()], [0.75, 1.33])
    stretch = np.linalg.svd(shapes, compute_uv=False)
    assert np.isclose(stretch[:, 0] / stretch[:, 1], 3.3).any()
