"""Smooth dark blobs on a light ground, and where they are: positions that an image must keep."""

import numpy as np
from numpy.typing import NDArray

REACH_PX = 14


def blobs(shape: tuple[int, int], centers: NDArray[np.float64], sigma_px: float = 2.5) -> NDArray[np.float32]:
    """Return a (H, W) image of level 200 with Gaussian blobs of level 20 at (n, 2) px."""
    y, x = np.mgrid[: shape[0], : shape[1]]
    dark = sum(np.exp(-((x - cx) ** 2 + (y - cy) ** 2) / (2 * sigma_px**2)) for cx, cy in centers)
    return np.asarray(200 - 180 * dark, dtype=np.float32)


def centroids(image: NDArray[np.generic], centers: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the (n, 2) centroids of what is darker than its surroundings near (n, 2) px."""
    found = []
    for center in centers:
        left, top = np.round(center).astype(int) - REACH_PX
        window = image[top : top + 2 * REACH_PX + 1, left : left + 2 * REACH_PX + 1].astype(np.float64)
        ring = np.concatenate([window[:2].ravel(), window[-2:].ravel(), window[:, :2].ravel(), window[:, -2:].ravel()])
        dark = ring.mean() - window
        y, x = np.mgrid[: len(window), : len(window)]
        found.append([left + (dark * x).sum() / dark.sum(), top + (dark * y).sum() / dark.sum()])
    return np.array(found)
