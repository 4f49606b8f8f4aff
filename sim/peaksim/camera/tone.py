"""Tone curves: how a camera codes linear levels as those of an image; both 0…1, black and white fixed."""

from collections.abc import Sequence

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from peaksim.errors import SceneError

Points = tuple[tuple[float, float], ...]

_MEASURED: Points = (
    (0.0, 0.0),
    (0.005, 0.030),
    (0.01, 0.049),
    (0.02, 0.081),
    (0.04, 0.136),
    (0.07, 0.206),
    (0.1, 0.270),
    (0.15, 0.366),
    (0.2, 0.448),
    (0.3, 0.581),
    (0.4, 0.680),
    (0.5, 0.758),
    (0.6, 0.822),
    (0.7, 0.876),
    (0.8, 0.923),
    (0.9, 0.964),
    (1.0, 1.0),
)
"""The mean of 201 responses that were measured of films and cameras (Grossberg and Nayar 2003, "What is the space of
camera response functions?", doi:10.1109/CVPR.2003.1211522), to 0.001. Next to sRGB it has darker shadows and
brighter lights."""

CURVES = ("linear", "srgb", "s-curve")
"""Names of curves: none, IEC 61966-2-1, and the mean of measured cameras."""

_MOST_POINTS = 1000
_ENTRIES = 4095


def coded(levels: ArrayLike, tone: str | Points) -> NDArray[np.float32]:
    """Return levels 0…1 as a tone curve codes them; beyond 0…1 they are clipped.

    `tone` is one of `CURVES`, or points (linear, coded) that are joined by a monotone cubic (Fritsch and Carlson 1980).
    """
    linear = np.clip(np.asarray(levels, dtype=np.float32), 0, 1)
    if tone == "linear":
        return linear
    if tone == "srgb":
        power = np.float32(1.055) * linear ** np.float32(1 / 2.4) - np.float32(0.055)
        return np.where(linear <= np.float32(0.0031308), np.float32(12.92) * linear, power)
    x, y = np.array(_MEASURED if isinstance(tone, str) else tone).T
    # a table over the root of the level, linear between its entries
    table = scipy.interpolate.PchipInterpolator(x, y)(np.linspace(0, 1, _ENTRIES + 2) ** 2).astype(np.float32)
    at = np.sqrt(linear) * np.float32(_ENTRIES + 1)
    first = np.minimum(at.astype(np.int32), _ENTRIES)
    before = table[first]
    return np.asarray(before + (at - first) * (table[first + 1] - before), dtype=np.float32)


def check_tone(tone: object, field: str) -> str | Points:
    """Return a tone curve's name, or its points as tuples of numbers.

    Raises
    ------
    SceneError
        If there is no curve of that name, or the points do not rise from linear 0 to linear 1.
    """
    if isinstance(tone, str) and tone in CURVES:
        return tone
    points = _points(tone)
    if points is None:
        expected = f"one of {', '.join(CURVES)}, or points [linear, coded] that rise from [0, …] to [1, …], in 0…1"
        raise SceneError(f"{field}: expected {expected}, got {tone!r:.80}")
    return points


def _points(tone: object) -> Points | None:
    if isinstance(tone, str) or not isinstance(tone, Sequence | np.ndarray):
        return None
    try:
        table = np.array(tone, dtype=np.float64)
    except (TypeError, ValueError):
        return None
    if table.ndim != 2 or table.shape[1] != 2 or not 2 <= len(table) <= _MOST_POINTS:
        return None
    x, y = table.T
    rises = (np.diff(x) > 0).all() and (np.diff(y) >= 0).all() and x[0] == 0 and x[-1] == 1
    return tuple((float(a), float(b)) for a, b in table) if rises and y[0] >= 0 and y[-1] <= 1 else None
