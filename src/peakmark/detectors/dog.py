"""The signed difference of Gaussians at SIFT's key points, which OpenCV's SIFT and pycolmap's leave out."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from peakmark.markers.patterns import DOG_RATIO

_TEXELS_AT_ONCE = 2_000_000
"""Of the windows that are weighted together: 16 MB."""


def dog_responses(gray: NDArray[np.uint8], xy: ArrayLike, sigma: ArrayLike) -> NDArray[np.float64]:
    """Return the (n,) DoG G(2^⅓ σ) − G(σ) of an image (0…1) at positions (n, 2) and scales (n,), px, edges repeated.

    Positive where the centre is dark, as SURF's trace is.
    """
    places, scales = np.asarray(xy, np.float64).reshape(-1, 2), np.asarray(sigma, np.float64).reshape(-1)
    reaches = np.ceil(4 * DOG_RATIO * scales).astype(np.intp)
    found = np.zeros(len(scales))
    for reach in np.unique(reaches):
        rows = np.flatnonzero(reaches == reach)
        parts = -(-len(rows) * (2 * int(reach) + 1) ** 2 // _TEXELS_AT_ONCE)
        for part in np.array_split(rows, parts):
            found[part] = _of_one_reach(gray, places[part], scales[part], int(reach))
    return found


def _of_one_reach(
    gray: NDArray[np.uint8], xy: NDArray[np.float64], sigma: NDArray[np.float64], reach: int
) -> NDArray[np.float64]:
    nearest = np.rint(xy).astype(np.intp)
    offsets = np.arange(-reach, reach + 1)
    columns, rows = (np.clip(nearest[:, k, None] + offsets, 0, gray.shape[1 - k] - 1) for k in (0, 1))
    windows = gray[rows[:, :, None], columns[:, None, :]] / 255.0
    across, down = (nearest[:, k, None] + offsets - xy[:, k, None] for k in (0, 1))
    return _blurred(windows, across, down, DOG_RATIO * sigma) - _blurred(windows, across, down, sigma)


def _blurred(
    windows: NDArray[np.float64], across: NDArray[np.float64], down: NDArray[np.float64], sigma: NDArray[np.float64]
) -> NDArray[np.float64]:
    lines = np.matmul(_normal(down, sigma)[:, None, :], windows)[:, 0]
    return np.asarray((lines * _normal(across, sigma)).sum(axis=1))


def _normal(x: NDArray[np.float64], sigma: NDArray[np.float64]) -> NDArray[np.float64]:
    weights = np.exp(-(x**2) / (2 * sigma[:, None] ** 2))
    return np.asarray(weights / weights.sum(axis=1, keepdims=True))
