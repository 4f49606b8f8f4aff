"""A Bayer mosaic of colour filters over the photosites, and the colours that are computed from it again."""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

Levels = NDArray[np.float32]

MOSAICS = {"rggb": (0, 1, 1, 2), "bggr": (2, 1, 1, 0), "grbg": (1, 0, 2, 1), "gbrg": (1, 2, 0, 1)}
"""Channels of the photosites at (0, 0), (0, 1), (1, 0) and (1, 1), row and column."""

# Malvar, He and Cutler 2004 (doi:10.1109/ICASSP.2004.1326587), Figure 2, in eighths
_GREEN = np.array([[0, 0, -1, 0, 0], [0, 0, 2, 0, 0], [-1, 2, 4, 2, -1], [0, 0, 2, 0, 0], [0, 0, -1, 0, 0]]) / 8
_ALONG_ROW = np.array([[0, 0, 1, 0, 0], [0, -2, 0, -2, 0], [-2, 8, 10, 8, -2], [0, -2, 0, -2, 0], [0, 0, 1, 0, 0]]) / 16
_ACROSS = np.array([[0, 0, -3, 0, 0], [0, 4, 0, 4, 0], [-3, 0, 12, 0, -3], [0, 4, 0, 4, 0], [0, 0, -3, 0, 0]]) / 16


def behind_filters(levels: Levels, mosaic: str) -> Levels:
    """Return the (H, W) levels of photosites, each behind one colour's filter, of (H, W, 3) light."""
    sites = np.empty(levels.shape[:2], dtype=np.float32)
    for k, channel in enumerate(MOSAICS[mosaic]):
        rows, columns = slice(k // 2, None, 2), slice(k % 2, None, 2)
        sites[rows, columns] = levels[rows, columns, channel]
    return sites


def demosaic(sites: Levels, mosaic: str) -> Levels:
    """Return the (H, W, 3) levels of photosites (H, W): each missing colour by a linear filter of 5×5 photosites.

    Malvar, He and Cutler 2004. The filters are symmetric, so that what they blur stays where it is.
    """
    green, along_row, across = (_filtered(sites, kernel) for kernel in (_GREEN, _ALONG_ROW, _ACROSS))
    along_column = _filtered(sites, _ALONG_ROW.T)
    layout = MOSAICS[mosaic]
    out = np.empty((*sites.shape, 3), dtype=np.float32)
    for k, own in enumerate(layout):
        here = slice(k // 2, None, 2), slice(k % 2, None, 2)
        beside = layout[k ^ 1]
        for channel in range(3):
            if channel == own:
                source = sites
            elif own != 1:
                source = green if channel == 1 else across
            else:
                source = along_row if channel == beside else along_column
            out[(*here, channel)] = source[here]
    return out


def _filtered(sites: Levels, kernel: NDArray[Any]) -> Levels:
    # mirrored about the outermost photosites, which keeps the mosaic's pattern
    kernel = np.asarray(kernel, dtype=np.float32)
    return np.asarray(cv2.filter2D(sites, -1, kernel, borderType=cv2.BORDER_REFLECT_101), dtype=np.float32)
