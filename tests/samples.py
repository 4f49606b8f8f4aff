"""Key points and images that tests share."""

import cv2
import numpy as np
from numpy.typing import NDArray

from peakmark.keypoints.keypoints import Keypoints


def some_keypoints(n: int = 5, descriptor_length: int | None = 4, seed: int = 0) -> Keypoints:
    rng = np.random.default_rng(seed)
    return Keypoints(
        xy=rng.uniform(0, 500, (n, 2)).astype(np.float32),
        size=rng.integers(9, 60, n).astype(np.float32),
        angle=rng.uniform(0, 360, n).astype(np.float32),
        response=rng.uniform(100, 1e5, n).astype(np.float32),
        octave=rng.integers(0, 4, n).astype(np.int32),
        laplacian=rng.integers(-1, 2, n).astype(np.int8),
        scale=rng.uniform(9, 60, n).astype(np.float32),
        descriptors=None if descriptor_length is None else rng.normal(size=(n, descriptor_length)).astype(np.float32),
    )


def assert_equal(a: Keypoints, b: Keypoints) -> None:
    assert a.columns().keys() == b.columns().keys()
    for name, column in a.columns().items():
        np.testing.assert_array_equal(column, getattr(b, name), err_msg=name)
        assert column.dtype == getattr(b, name).dtype


def speckled(height: int, width: int, seed: int = 0) -> NDArray[np.uint8]:
    """Noise at several scales: blobs of many sizes, anywhere."""
    rng = np.random.default_rng(seed)
    levels = sum(
        cv2.GaussianBlur(rng.normal(0, 40 * sigma, (height, width)).astype(np.float32), (0, 0), sigma)
        for sigma in (1.5, 3.0, 6.0, 12.0)
    )
    return np.clip(128 + levels, 0, 255).astype(np.uint8)  # type: ignore[union-attr]
