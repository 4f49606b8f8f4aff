"""How near and how far a printed marker is found, for a camera: read from measured rates over size and tilt.

The rates ship with the package, as `scripts/detectability.py` measured them over random phases, rotations and tilt
axes; sides of SIFT markers are the printed 12 σ. Without tilt a marker of side S at distance Z is f·S / Z px large,
f being the focal length in px; its perspective is that of 20 marker sides away.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import groupby
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from peaksim.text_file import read_text

from peakmark.errors import InputError

REQUIRED = 0.95
"""A condition is inside the envelope where the lower end of the detection rate's 95 % interval reaches this."""

COLUMNS = ("marker", "detector", "noise", "tilt_deg", "side_px", "detected", "detected_low")
"""Of the shipped table."""

_LARGEST_FILE = 10_000_000  # bytes


@dataclass(frozen=True, eq=False)
class Rates:
    """Detection rates of one marker and detector at one noise, over tilts (t,) × sides (s,)."""

    tilt_deg: NDArray[np.float64]
    """(t,) rising."""
    side_px: NDArray[np.float64]
    """(s,) side in the image without tilt, rising."""
    detected: NDArray[np.float64]
    """(t, s) share of the trials."""
    detected_low: NDArray[np.float64]
    """(t, s) lower end of its 95 % interval."""


@dataclass(frozen=True)
class Reach:
    """Distances at which a marker is found at one tilt."""

    tilt_deg: float
    """Between the marker's normal and the ray to the camera."""
    nearest_m: float | None
    farthest_m: float | None
    """Nearest and farthest measured distance inside the envelope; None if there is none."""
    gaps_m: tuple[tuple[float, float], ...]
    """Distances between them where a measured size fails, from its nearer to its farther good neighbour."""


def load_rates(
    marker: str = "surf-dark", detector: str = "surf", noise: float = 0.0, path: Path | None = None
) -> Rates:
    """Return measured rates, the shipped ones unless `path` names another envelope.csv.

    An `InputError` says that the file cannot be read, or which combinations it has instead of this one.
    """
    table = _table(path)
    key = (marker, detector, f"{noise:g}")
    rows = [row for row in table if row[:3] == key]
    if not rows:
        known = ", ".join("/".join(combination) for combination in sorted({row[:3] for row in table}))
        raise InputError(f"envelope: expected one of marker/detector/noise {known}, got {'/'.join(key)}")
    tilts, sides = (np.array(sorted({float(row[k]) for row in rows})) for k in (3, 4))
    values = {(float(row[3]), float(row[4])): (float(row[5]), float(row[6])) for row in rows}
    if len(values) != len(tilts) * len(sides):
        raise InputError(f"envelope: expected a rate for each tilt and side of {'/'.join(key)}, some are missing")
    grid = np.array([[values[tilt, side] for side in sides] for tilt in tilts])
    return Rates(tilts, sides, grid[:, :, 0], grid[:, :, 1])


@cache
def _table(path: Path | None) -> tuple[tuple[str, ...], ...]:
    file = path or Path(__file__).with_name("envelope.csv")
    head, *lines = read_text(file, _LARGEST_FILE).splitlines() or [""]
    if tuple(head.split(",")) != COLUMNS:
        raise InputError(f"{file}: expected columns {', '.join(COLUMNS)}, got {head[:80]!r}")
    rows = tuple(tuple(line.split(",")) for line in lines)
    for number, row in enumerate(rows, 2):
        if len(row) != len(COLUMNS) or not all(map(_is_number, row[3:])):
            expected = f"{len(COLUMNS)} columns, numbers from {COLUMNS[3]} on"
            raise InputError(f"{file}: line {number}: expected {expected}, got {lines[number - 2]!r:.80}")
    return rows


def _is_number(text: str) -> bool:
    try:
        return bool(np.isfinite(float(text)))
    except ValueError:
        return False


def reach(rates: Rates, focal_px: float, side_m: float, required: float = REQUIRED) -> list[Reach]:
    """Return the distances at which a marker of side `side_m` is found, tilt by tilt.

    The focal length and the side must be positive, the required rate in 0…1; else an `InputError`.
    """
    if not 0 < required < 1:
        raise InputError(f"required rate: expected a number between 0 and 1, got {required}")
    distances_m = distance_m(rates.side_px, focal_px, side_m)
    return [
        _reach(float(tilt), distances_m[::-1], low[::-1] >= required)
        for tilt, low in zip(rates.tilt_deg, rates.detected_low, strict=True)
    ]


def distance_m(side_px: NDArray[np.float64], focal_px: float, side_m: float) -> NDArray[np.float64]:
    """Return the distance from which a marker of side `side_m` is `side_px` large without tilt."""
    for name, value in (("focal length", focal_px), ("side", side_m)):
        if not (np.isfinite(value) and value > 0):
            raise InputError(f"{name}: expected a positive number, got {value}")
    return np.asarray(focal_px * side_m / side_px)


def _reach(tilt_deg: float, distances_m: NDArray[np.float64], is_good: Sequence[bool] | NDArray[np.bool_]) -> Reach:
    """Return the reach over rising distances."""
    good = np.flatnonzero(is_good)
    if len(good) == 0:
        return Reach(tilt_deg, None, None, ())
    runs = [list(run) for fine, run in groupby(range(good[0], good[-1]), lambda k: bool(is_good[k])) if not fine]
    gaps = tuple((float(distances_m[run[0] - 1]), float(distances_m[run[-1] + 1])) for run in runs)
    return Reach(tilt_deg, float(distances_m[good[0]]), float(distances_m[good[-1]]), gaps)


def sentence(side_m: float, one: Reach) -> str:
    """Return a reach in words, such as "8 cm: 0.7 to 4.1 m at 60°, but not 1.2 to 1.5 m"."""
    size = f"{100 * side_m:g} cm at {one.tilt_deg:g}°"
    if one.nearest_m is None or one.farthest_m is None:
        return f"{size}: not found"
    gaps = " and ".join(f"{near:.2g} to {far:.2g} m" for near, far in one.gaps_m)
    return f"{size}: {one.nearest_m:.2g} to {one.farthest_m:.2g} m" + (f", with misses from {gaps}" if gaps else "")
