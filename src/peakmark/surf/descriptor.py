"""SURF's descriptor: gradients of a rotated window, summed in 4×4 cells."""

import numpy as np
from numpy.typing import NDArray
from peaksim.native import function

from peakmark.parallel import bands, map_parallel, thread_count
from peakmark.surf.orientation import gaussian
from peakmark.surf.window import PATCH_PITCH, PATCH_SIDE, interleave_rows

GRADIENTS = PATCH_SIDE - 1
"""Gradients a side: differences of neighbouring patch pixels."""
CELL_SIGMA = 3.3
"""Standard deviation of the Gaussian window over the patch, in gradients; OpenCV's."""

STRIP_PX = 32
"""Key points are described strip of rows by strip; set by hand, 16 to 128 take as long."""

_WEIGHTS = np.zeros((GRADIENTS, PATCH_PITCH), dtype=np.float32)
_WEIGHTS[:, :GRADIENTS] = np.outer(gaussian(GRADIENTS, CELL_SIGMA), gaussian(GRADIENTS, CELL_SIGMA))


_describe_rows = function(
    "status describe_rows(const u2[height,stride] pairs, i8 width, const i8[count] rows, const f4[n,2] xy, "
    "const i4[n] sides, const f4[n] angle, b1 extended, b1 upright, const f4[20,24] weights, f4[n,length] descriptors)"
)


def window_side(size: NDArray[np.float32]) -> NDArray[np.int32]:
    """Side of the described window, px: trunc(21 s) with s = 1.2 size / 9, in single precision."""
    s = size.astype(np.float32) * np.float32(1.2) / np.float32(9.0)
    return (np.float32(PATCH_SIDE) * s).astype(np.int32)


def describe_windows(
    gray: NDArray[np.uint8],
    xy: NDArray[np.float32],
    size: NDArray[np.float32],
    angle: NDArray[np.float32],
    extended: bool,
    upright: bool,
) -> NDArray[np.float32]:
    """Descriptors (n, 64 or 128), each of unit length or all zero.

    Parameters
    ----------
    gray : (H, W) contiguous uint8 image.
    xy, size, angle : (n, 2), (n,), (n,) float32; px, px, degrees.
    extended : 128 entries, split by the gradients' signs.
    upright : do not rotate the window, whatever the angle.
    """
    descriptors = np.empty((len(size), 128 if extended else 64), dtype=np.float32)
    pairs, sides = interleave_rows(gray), window_side(size)
    rows = np.argsort(xy[:, 1] // STRIP_PX * gray.shape[1] + xy[:, 0])  # neighbours in the image share its cache lines

    def describe(cut: tuple[int, int]) -> None:
        chosen = rows[slice(*cut)]
        _describe_rows(pairs, gray.shape[1], chosen, xy, sides, angle, extended, upright, _WEIGHTS, descriptors)

    map_parallel(describe, bands(len(size), 8 * thread_count()))
    return descriptors
