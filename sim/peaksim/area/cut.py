"""Pixels that several faces share, cut into the visible pieces of each."""

import numpy as np
from numpy.typing import NDArray

from peaksim.area.cells import Cells, Rays
from peaksim.native import function

MAX_PIECES = 64
"""Most pieces of one face in a pixel; further ones are dropped."""
MAX_VERTICES = 24
"""Each cut of a polygon adds one vertex at most; further ones are dropped."""
ROW, COLUMN, FACE, SIZE = 0, 1, 2, 3
"""Columns of a list of pieces: pixel, face, number of vertices."""

Lists = tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64]]
"""(p, MAX_VERTICES, 2), (p, 4) and (p,): each piece in the coordinates of its face (texels), its pixel, face and size,
and its share of the pixel."""

_cut_mixed = function(
    "status cut_mixed(const f8[rows,columns,3] rays, const f8[poses,faces,5,3] sides, const i8[height,width] owners, "
    "const i8[height,width] cells, const i8[lists,room] found, const i8[lists] counts, "
    "const f8[height,width,channels] background, i8[2] progress, "
    "f8[n,24,2] polygons, i8[n,4] pieces, f8[n] shares, f4[height,width,channels] out)"
)


def new_lists(most: int) -> Lists:
    """Return memory for so many pieces."""
    return np.empty((most, MAX_VERTICES, 2)), np.empty((most, 4), np.int64), np.empty(most)


def cut_mixed(
    rays: Rays,
    sides: NDArray[np.float64],
    cells: Cells,
    background: NDArray[np.float64],
    first: int,
    lists: Lists,
    out: NDArray[np.float32],
) -> tuple[int, int]:
    """List the visible pieces of all MIXED pixels of a band from pixel `first` on, and add background where none is.

    Parameters
    ----------
    rays, sides
        As in `find_owners`.
    cells
        Which faces share each pixel.
    background
        (h, w, channels) levels where nothing is.
    first
        Row-major number of the pixel to begin with.
    lists
        Written.
    out
        (h, w, channels) background added.

    Returns
    -------
    n, next
        Number of pieces; the pixel to continue with if the lists were full, else h·w.
    """
    progress = np.array([first, 0])
    _cut_mixed(rays, sides, *cells, background, progress, *lists, out)
    return int(progress[1]), int(progress[0])
