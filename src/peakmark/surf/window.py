"""What cuts SURF's window out of an image and average it down to the 21×21 patch that is described."""

import numpy as np
from numpy.typing import NDArray
from peaksim.native import function

from peakmark.parallel import bands, map_parallel, thread_count
from peakmark.surf.integral import padded_length

PATCH_SIDE = 21
"""Side of the patch, px."""
PATCH_PITCH = 24
"""Distance of the patch's columns in memory: PATCH_SIDE rounded up to whole vectors."""

_interleave_rows = function(
    "void interleave_rows(const u1[height,width] gray, u2[height,stride] pairs, i8 first, i8 end)"
)
_cut_window = function(
    "status cut_window(const u2[height,stride] pairs, i8 width, f4 x, f4 y, f4 angle_deg, b1 upright, "
    "u1[side,side] window)"
)
_average_window = function("status average_window(const u1[side,side] window, u1[21,21] patch)")


def interleave_rows(gray: NDArray[np.uint8]) -> NDArray[np.uint16]:
    """Each pixel of an (H, W) image with the one below it, as upper | lower << 8; below the last row, that row again.

    Two neighbouring entries are then the four pixels that bilinear sampling needs. (H, padded W + 1), see
    `padded_length`; entries beyond the image are undefined.
    """
    pairs = np.empty((gray.shape[0], padded_length(gray.shape[1] + 1, 2)), dtype=np.uint16)
    cuts = bands(gray.shape[0], thread_count())
    map_parallel(lambda cut: _interleave_rows(gray, pairs, *cut), cuts)
    return pairs


def cut_window(
    gray: NDArray[np.uint8], x: float, y: float, angle_deg: float, side: int, upright: bool = False
) -> NDArray[np.uint8]:
    """Return the (side, side) window of an image around a position, px, rotated by an angle.

    Bilinear and rounded to 8 bits; outside the image the nearest pixel. Upright: rotated by 270° whatever the angle,
    whole pixels, rows running up the image.
    """
    window = np.empty((side, side), dtype=np.uint8)
    _cut_window(interleave_rows(gray), gray.shape[1], x, y, angle_deg, upright, window)
    return window


def average_window(window: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return a (side, side) window averaged by area onto the patch (21, 21), rounded: OpenCV's INTER_AREA.

    Lengths are counted in 1 / 21 px, so that pixels are 21 and patch pixels `side` units wide: all sums are exact.
    """
    patch = np.empty((PATCH_SIDE, PATCH_SIDE), dtype=np.uint8)
    _average_window(window, patch)
    return patch
