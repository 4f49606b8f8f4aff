"""The edges of the square that a round marker is printed in, in whatever rotation it lies."""

import cv2
import numpy as np
from numpy.typing import NDArray

from peakmark.identification.alignment import Aligned
from peakmark.refine.round import ROUND_SPAN

_TURNS = np.radians(np.arange(0, 90, 7.5))
_ALONG = np.linspace(-0.36, 0.36, 5)
_INSIDE, _OUTSIDE = 0.42, 0.57
"""Distances from the centre, sides, between which the edge lies under some blur."""


def square_edges(gray: NDArray[np.uint8], aligned: Aligned) -> NDArray[np.float64]:
    """Return (n, 4) of alignments of round patterns: the two lowest and the highest edge, and the deviation inside.

    An edge is how much lighter it is outside than inside, over gain, in the rotation where the four together are most.
    """
    if not len(aligned.theta):
        return np.empty((0, 4))
    theta, points = aligned.theta, _square_points() / ROUND_SPAN
    depth = np.maximum(1 + np.einsum("tslki,ni->ntslk", points, theta[:, 6:8]), 0.05)
    moved = np.einsum("nij,tslkj->ntslki", theta[:, 2:6].reshape(-1, 2, 2), points) / depth[..., None]
    xy = (theta[:, None, None, None, None, :2] + moved).astype(np.float32).reshape(len(theta), -1, 2)
    x, y = np.ascontiguousarray(xy.transpose(2, 0, 1))
    shown = np.asarray(cv2.remap(gray, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), dtype=np.float64)
    levels = shown.reshape(len(theta), *points.shape[:-1]) / np.maximum(theta[:, 8], 1.0)[:, None, None, None, None]
    steps = np.diff(levels.mean(axis=4), axis=3)[..., 0]
    best = steps.sum(axis=2).argmax(axis=1)
    rows = np.arange(len(theta))
    ground = levels[rows, best, :, 0].reshape(len(theta), -1).std(axis=1)
    return np.column_stack([np.sort(steps[rows, best], axis=1)[:, [0, 1, 3]], ground])


def _square_points() -> NDArray[np.float64]:
    """Return (t, 4, 2, k, 2) points in sides: rotations, sides of the square, inside and outside, along it."""
    away = np.array([_INSIDE, _OUTSIDE])
    one = np.stack(np.broadcast_arrays(away[:, None], _ALONG[None]), axis=-1)
    turns = _TURNS[:, None] + np.arange(4) * np.pi / 2
    c, s = np.cos(turns), np.sin(turns)
    return np.asarray(np.einsum("tsij,lkj->tslki", np.stack([np.stack([c, -s], -1), np.stack([s, c], -1)], -2), one))
