"""Runs of pixels that one face fills, each the mean of the texture over the pixel's footprint."""

import numpy as np
from numpy.typing import NDArray

from peaksim.area.faces import Faces, FaceViews
from peaksim.native import function

_fill_owned = function(
    "void fill_owned(const f8[rows,columns,3] rays, const f8[poses,faces,5,3] sides, const b1[poses,faces] printed, "
    "const f8[faces,28] table, const f8[n_texels] texels, const i8[height,width] owners, "
    "const f8[height,width,channels] background, "
    "f8[channels,width] shared, i8[width] previous, f4[height,width,channels] out)"
)


def fill_owned(
    rays: NDArray[np.float64],
    views: FaceViews,
    faces: Faces,
    owners: NDArray[np.int64],
    background: NDArray[np.float64],
    out: NDArray[np.float32],
) -> None:
    """Write all pixels of a band that have an owner; the others become 0.

    Parameters
    ----------
    rays
        (h + 1, w + 1, 3) directions of the pixel corners.
    views, faces
        Faces from the camera's pose, or from one for each row.
    owners
        (h, w) face, NOTHING or MIXED.
    background
        (h, w, channels) levels of NOTHING.
    out
        (h, w, channels) written.
    """
    width, channels = out.shape[1:]
    shared, previous = np.empty((channels, width)), np.full(width, -1)
    _fill_owned(rays, views.sides, views.printed, faces.table, faces.texels, owners, background, shared, previous, out)
