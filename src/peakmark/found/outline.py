"""What a marker or an array covers in the image."""

import numpy as np
from numpy.typing import NDArray

from peakmark.arrays.decode import MarkerArray


def outline_px(array: MarkerArray) -> NDArray[np.float64]:
    """Return (4, 2) corners around an array's markers, px; from the blank corner clockwise where it has a code."""
    if array.code is None:
        reach = 1.2 * np.mean([d.size for d in array.detections])
        xy = np.array([d.xy for d in array.detections])
        (x0, y0), (x1, y1) = xy.min(axis=0) - reach, xy.max(axis=0) + reach
        return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
    layout, steps = array.layout, array.steps_px
    cells = np.array(layout.cells, dtype=np.float64)
    origin = array.xy - cells.mean(axis=0) @ steps.T
    low, high = np.array([-0.5, -0.5]), np.array([layout.columns, layout.rows]) - 0.5
    corners = np.array([low, [high[0], low[1]], high, [low[0], high[1]]])
    return np.asarray(origin + corners @ steps.T)
