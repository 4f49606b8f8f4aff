"""Integral images: sums over upright boxes from four corners (Viola and Jones, 2001, doi:10.1109/CVPR.2001.990517).

Sums are kept modulo 2^32 in int32. Differences of such sums are exact as long as the box itself sums to less than
2^31, whatever the size of the image: a box over 8-bit pixels may span 8.4 megapixels, the image any number.
"""

import numpy as np
from numpy.typing import NDArray
from peaksim.native import function

from peakmark.parallel import bands, map_parallel, thread_count

_sum_columns = function("void sum_columns(const u1[rows,width] pixels, i4[width] sums)")
_integrate = function("void integrate(const u1[rows,width] pixels, const i4[width] above, i4[room,stride] sums)")


def integral_image(gray: NDArray[np.uint8]) -> NDArray[np.int32]:
    """Sums over all boxes that start at the top-left corner, modulo 2^32.

    Parameters
    ----------
    gray : (H, W) uint8 array, any strides.

    Returns
    -------
    (H + 1, W + 1) int32 array; entry [y, x] is the sum of gray[:y, :x], so row 0 and column 0 are zero.

    Examples
    --------
    >>> integral_image(np.array([[1, 2], [3, 4]], dtype=np.uint8)).tolist()
    [[0, 0, 0], [0, 1, 3], [0, 4, 10]]
    """
    return padded_integral(gray)[:, : gray.shape[1] + 1]


def padded_integral(gray: NDArray[np.uint8]) -> NDArray[np.int32]:
    """`integral_image` as the kernels want it: contiguous, its rows padded to `padded_length` with undefined values."""
    pixels = np.ascontiguousarray(gray)
    height, width = pixels.shape
    sums = np.empty((height + 1, padded_length(width + 1, 4)), dtype=np.int32)
    sums[0] = 0
    cuts = bands(height, thread_count())
    above = np.zeros((len(cuts) + 1, width), dtype=np.int32)
    map_parallel(lambda i: _sum_columns(pixels[slice(*cuts[i])], above[i + 1]), range(len(cuts) - 1))
    np.cumsum(above, axis=0, dtype=np.int32, out=above)
    np.cumsum(above, axis=1, dtype=np.int32, out=above)
    map_parallel(lambda i: _integrate(pixels[slice(*cuts[i])], above[i], sums[cuts[i][0] + 1 :]), range(len(cuts)))
    return sums


def padded_length(length: int, itemsize: int) -> int:
    """Row length, in items, that is an odd number of cache lines: rows 2^n long would share a few sets of the cache."""
    lines = -(-length * itemsize // 64)
    return (lines | 1) * 64 // itemsize
