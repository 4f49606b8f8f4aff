"""Looking for an array's markers where they should stand: beside a marker that was found.

A marker that was found tells where its neighbours are in its plane, so that the place where one should be can be
rectified and compared with the printed patterns by correlation. That asks much less of the image than finding the
marker anywhere: blur, noise and light that hide it from the search leave it plain here.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from typing import NamedTuple, get_args

import cv2
import numpy as np
from numpy.typing import NDArray

from peakmark.arrays.lattice import Cell
from peakmark.markers.optimum import Limit
from peakmark.markers.patterns import Made, Polarity, Variant, marker_image

AROUND: tuple[Cell, ...] = ((-1, -1), (0, -1), (1, -1), (-1, 0), (1, 0), (-1, 1), (0, 1), (1, 1))
"""Cells of the lattice around a marker."""


class Print(NamedTuple):
    """Which markers an array is printed of, light and dark."""

    made_for: Made = "surf"
    limit: Limit = "energy"


OF_SURF = Print()
"""The paper's."""

EVIDENCE: dict[Made, tuple[float, float]] = {"surf": (-41.8, 50.0), "sift": (-41.8, 50.0)}
"""Offset of the log odds that a marker stands where one should, and their slope by correlation. Set by hand, between
what was measured. Of SURF's, paper and walls stay below 0.87 (1344 looks), plain discs and squares in its place reach
0.89, markers 0.92 and more in nine of ten hard views (1001 looks); 0.93 is a probability of 0.99. Of SIFT's, walls
stay below 0.83 (302 looks), markers of 15…42 px at up to 62° reach 0.9 and more (108); a dot there is one."""

REACH = 0.25
"""A marker may stand this far from where it should, in sides: perspective and the errors of a shape."""

_SIDE_TEXELS = 14
"""Resolution of the rectified place."""

_HALF = 0.65
"""Half the side of what is compared, in sides: the pattern and the white around it."""

_BLUR, _TONE = 0.07, 1.4
"""Of the template: blur in sides, and the exponent of a tone curve between a linear camera's and sRGB's."""

_EDGE, _EDGE_COST = 0.25, 0.02
"""Share of the width that may be left out at one edge, and what that costs of the correlation."""

_OPEN = (0.55, 0.93)
"""Correlations between which a marker may be covered in part."""

_PERSPECTIVES = (0.0, -0.65, 0.65, -1.3, 1.3)
"""Strengths of perspective that are tried, in those of a camera whose focal length is the image's longer side."""

_SLIGHT = 0.02
"""Perspective a step below which only none is tried: it moves a neighbour less than it may be off anyway."""


@dataclass(frozen=True, eq=False)
class Sighting:
    """What is seen best where a marker should stand."""

    xy: NDArray[np.float64]
    """(2,) centre, px."""
    affinity: NDArray[np.float64]
    """(2, 2) px per side there."""
    polarity: Polarity
    """Of the pattern that correlates better."""
    printed: Print
    """The two patterns."""
    correlation: float
    """With it, −1…1."""

    @property
    def side_px(self) -> float:
        """Root of the area, px."""
        return float(np.sqrt(abs(np.linalg.det(self.affinity))))

    @property
    def probability(self) -> float:
        """That a marker stands there."""
        return probability_of(self.correlation, self.printed)


def probability_of(correlation: float, printed: Print) -> float:
    """Return how probable a marker is where one should stand and its pattern correlates so well."""
    offset, slope = EVIDENCE[printed.made_for]
    return float(1 / (1 + np.exp(-(offset + slope * correlation))))


@dataclass(frozen=True, eq=False)
class _Softened:
    """A part of an image without what the rectified place has no texels for."""

    levels: NDArray[np.uint8]
    """(h, w) of the part."""
    origin: NDArray[np.float64]
    """(2,) px of its upper left pixel in the image."""
    size: NDArray[np.float64]
    """(2,) width and height of the image."""

    def at(self, px: NDArray[np.float64]) -> NDArray[np.uint8]:
        """Return the levels (h, w) at positions (h, w, 2) of the image; outside the part its border continues."""
        x, y = np.moveaxis(px - self.origin, -1, 0).astype(np.float32)
        return np.asarray(cv2.remap(self.levels, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE))

    def contains(self, px: NDArray[np.float64]) -> bool:
        """Return whether all positions (…, 2) lie in the image."""
        return bool((px > -0.5).all() and (px < self.size - 0.5).all())


def look_around(
    gray: NDArray[np.uint8],
    xy: NDArray[np.float64],
    affinity: NDArray[np.float64],
    pitch: float,
    printed: Print = OF_SURF,
) -> dict[Cell, Sighting]:
    """Return what is seen in the cells around a marker, those outside the (H, W) image left out.

    `xy` (2,) px and `affinity` (2, 2) px per side are the marker's, rotation included; `pitch` is the distance of
    neighbours in sides.
    """
    tilts = tuple(_tilts(affinity, float(max(gray.shape)), pitch))
    square = (pitch + _HALF + REACH) * _CORNERS
    soft = _softened(gray, affinity, np.concatenate([_projected(xy, affinity, tilt, square)[0] for tilt in tilts]))
    best: dict[Cell, Sighting] = {}
    for tilt in tilts:
        for cell, sighting in _sightings(soft, xy, affinity, tilt, pitch, printed):
            if cell not in best or sighting.correlation > best[cell].correlation:
                best[cell] = sighting
    return {cell: _without_cover(soft, sighting) for cell, sighting in best.items()}


def _without_cover(soft: _Softened, sighting: Sighting) -> Sighting:
    """Return the sighting again without its worst edge, where something may lie over it, if that explains more."""
    if not _OPEN[0] < sighting.correlation < _OPEN[1]:
        return sighting
    place = soft.at(_projected(sighting.xy, sighting.affinity, np.zeros(2), _GRID)[0])
    pattern = template(sighting.polarity, sighting.printed)
    cut = round(_EDGE * len(pattern))
    best = sighting
    for turns in range(4):
        shift, correlation = _best_shift(np.rot90(place, turns)[:, cut:], np.rot90(pattern, turns)[:, cut:])
        if correlation - _EDGE_COST > best.correlation:
            u = np.linalg.matrix_power(_QUARTER, turns) @ shift
            best = replace(sighting, xy=sighting.xy + sighting.affinity @ u, correlation=correlation - _EDGE_COST)
    return best


def correlation_at(
    gray: NDArray[np.uint8], xy: NDArray[np.float64], affinity: NDArray[np.float64], polarity: Polarity, printed: Print
) -> float:
    """Return how well a marker's pattern correlates with the image at a centre and under a shape."""
    count = round(_HALF * _SIDE_TEXELS)
    line = np.arange(-count, count + 1) / _SIDE_TEXELS
    px, _ = _projected(xy, affinity, np.zeros(2), np.stack(np.meshgrid(line, line), axis=-1))
    return _best_shift(_softened(gray, affinity, px.reshape(-1, 2)).at(px), template(polarity, printed))[1]


def _softened(gray: NDArray[np.uint8], affinity: NDArray[np.float64], px: NDArray[np.float64]) -> _Softened:
    """Return the part of an image within the box of positions (n, 2), softened for a marker's shape."""
    blur_px = 0.5 * float(np.linalg.norm(affinity, -2)) / _SIDE_TEXELS
    size = np.array(gray.shape[::-1])
    margin = 4 * blur_px + 2
    low = np.clip(np.floor(px.min(axis=0) - margin), 0, size - 1).astype(int)
    high = np.clip(np.ceil(px.max(axis=0) + margin), low, size - 1).astype(int) + 1
    part = gray[low[1] : high[1], low[0] : high[0]]
    soft = cv2.GaussianBlur(part, (0, 0), blur_px) if blur_px > 0.6 else part
    return _Softened(np.asarray(soft), low.astype(np.float64), size.astype(np.float64))


def _tilts(affinity: NDArray[np.float64], focal_px: float, pitch: float) -> Iterator[NDArray[np.float64]]:
    """Yield perspectives g (2,) of x = c + A u / (1 + g·u) that the shape of a marker allows.

    Its shortest axis shows the direction in which it recedes and how much, but not which way.
    """
    _, (longest, shortest), axes = np.linalg.svd(affinity)
    strength = longest / focal_px * np.sqrt(max(0.0, 1 - (shortest / longest) ** 2))
    tried = _PERSPECTIVES if strength * pitch > _SLIGHT else _PERSPECTIVES[:1]
    for factor in tried:
        yield factor * strength * axes[1]


def _sightings(
    soft: _Softened,
    xy: NDArray[np.float64],
    affinity: NDArray[np.float64],
    tilt: NDArray[np.float64],
    pitch: float,
    printed: Print,
) -> Iterator[tuple[Cell, Sighting]]:
    """Yield the best position in each cell around a marker, under one perspective."""
    reach = REACH + 1 / _SIDE_TEXELS
    line = np.arange(round(-(_HALF + reach) * _SIDE_TEXELS), round((_HALF + reach) * _SIDE_TEXELS) + 1) / _SIDE_TEXELS
    grid = np.stack(np.meshgrid(line, line), axis=-1)
    for cell in AROUND:
        middle = pitch * np.array(cell, dtype=np.float64)
        px, depth = _projected(xy, affinity, tilt, middle + grid)
        if depth.min() < 0.2 or not soft.contains(_projected(xy, affinity, tilt, middle + 0.5 * _CORNERS)[0]):
            continue
        place = soft.at(px)
        for polarity in get_args(Polarity):
            shift, correlation = _best_shift(place, template(polarity, printed))
            u = middle + shift
            center, w = _projected(xy, affinity, tilt, u)
            shape = (affinity - np.outer(center - xy, tilt)) / w
            yield cell, Sighting(center, shape, polarity, printed, correlation)


_LINE = np.arange(round(-(_HALF + 0.2) * _SIDE_TEXELS), round((_HALF + 0.2) * _SIDE_TEXELS) + 1) / _SIDE_TEXELS
_GRID = np.stack(np.meshgrid(_LINE, _LINE), axis=-1)
_QUARTER = np.array([[0.0, -1.0], [1.0, 0.0]])
_CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


def _projected(
    xy: NDArray[np.float64], affinity: NDArray[np.float64], tilt: NDArray[np.float64], u: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return (…, 2) px where points u (…, 2) of the plane are seen, and (…) their depths."""
    depth = np.asarray(1 + u @ tilt)
    return np.asarray(xy + u @ affinity.T / np.maximum(depth, 1e-3)[..., None]), depth


def _best_shift(place: NDArray[np.uint8], pattern: NDArray[np.float32]) -> tuple[NDArray[np.float64], float]:
    """Return where a pattern correlates best with a rectified place, in sides from its middle, and how well."""
    scores = np.asarray(cv2.matchTemplate(place.astype(np.float32), pattern, cv2.TM_CCOEFF_NORMED), dtype=np.float64)
    row, column = np.unravel_index(int(np.argmax(scores)), scores.shape)
    middle = (np.array(scores.shape) - 1) / 2
    peak = [column + _vertex(scores[row], int(column)), row + _vertex(scores[:, column], int(row))]
    return (np.array(peak) - middle[::-1]) / _SIDE_TEXELS, float(scores[row, column])


def _vertex(scores: NDArray[np.float64], k: int) -> float:
    """Return the offset of the vertex of the parabola through the largest of scores, at k, and its neighbours."""
    if not 0 < k < len(scores) - 1:
        return 0.0
    before, here, after = (float(s) for s in scores[k - 1 : k + 2])
    curvature = before - 2 * here + after
    return 0.0 if curvature >= 0 else 0.5 * (before - after) / curvature


@cache
def template(polarity: Polarity, printed: Print = OF_SURF) -> NDArray[np.float32]:
    """Return (n, n) levels of a softened marker on white, n odd, `_SIDE_TEXELS` a side, its centre in the middle."""
    fine = 9 * _SIDE_TEXELS
    levels = (marker_image(fine, Variant(polarity, printed.limit, printed.made_for)) / 255.0) ** _TONE
    soft = cv2.GaussianBlur(np.pad(levels, fine, constant_values=1.0), (0, 0), _BLUR * fine)
    count = round(_HALF * _SIDE_TEXELS)
    at = (3 * fine - 1) / 2 + 9 * np.arange(-count, count + 1)
    x, y = np.meshgrid(at.astype(np.float32), at.astype(np.float32))
    return np.asarray(cv2.remap(soft.astype(np.float32), x, y, cv2.INTER_LINEAR))
