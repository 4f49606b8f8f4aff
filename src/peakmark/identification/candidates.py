"""Where markers may be: blobs of five shapes, by response quotient.

A steep marker is a narrow blob, to which SURF's square filters hardly answer, but filters twice as long as wide do.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields

import cv2
import numpy as np
from numpy.typing import NDArray
from peaksim.native import function

from peakmark.identification.blobs import blob_rows
from peakmark.identification.detection import SIDE_OF_SCALE
from peakmark.parallel import bands

THRESHOLD = 300.0
"""Hessian threshold; 100, 300 and 500 find the same markers of 20 px and more."""

LEAST_QUOTIENT = 0.12
"""Response quotient from which a key point is a candidate."""

SMALLEST_PX = 12.0
"""Side of the smallest candidates."""

_SMALL_PX, _LEAST_OF_SMALL = 14.0, 0.3
"""Side below which a candidate's quotient must be higher, for letters and texture have many of less: set by hand, where
random images lost no marker of 15 px by it."""

PAGE = 800
"""Candidates that are looked at together, by falling worth."""

_BY_RESPONSE = 0.03
"""What a candidate's worth is by, besides its quotient, times the logarithm of its response: prints have contrast."""

_ALIKE = (0.18, 1.25)
"""Blobs of one sign this near, in scales, and this like in scale, are one candidate. Page, share and this are set by
hand: of 605 markers in 120 random images none comes behind the first page."""

_WHOLE_PIXELS = 2_500_000
"""Larger images are searched reduced by a whole number to less; in their own pixels only for what is small there."""

_SMALL_OCTAVES = (0, 1)
"""Octaves of these small ones: up to those of the first octave of an image reduced by 4."""
_STRIP_ROWS, _STRIP_MARGIN = 512, 64
"""Of the strips of a large image, which keep the room for sums small; and what a blob needs beyond them."""

_distinct_rows = function(
    "status distinct_rows(const f8[n,6] found, f8 near, f8 like, f8 width, f8 height, i8[n] kept, i8[1] count)"
)


Worth = Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]]


@dataclass(frozen=True)
class MarkerCandidates:
    """Positions at which a marker may be, by falling worth."""

    xy: NDArray[np.float64]
    """(n, 2) px."""
    sides_px: NDArray[np.float64]
    """(n,) about the side of the marker."""
    signs: NDArray[np.int8]
    """(n,) +1 where its centre is dark, −1 where light."""
    responses: NDArray[np.float64]
    """(n,) determinants of the Hessian."""
    quotients: NDArray[np.float64]
    """(n,) responses over the largest that the variance there allows."""

    def __getitem__(self, rows: NDArray[np.intp]) -> "MarkerCandidates":
        return MarkerCandidates(
            self.xy[rows], self.sides_px[rows], self.signs[rows], self.responses[rows], self.quotients[rows]
        )

    def __len__(self) -> int:
        return len(self.xy)


def candidate_pages(gray: NDArray[np.uint8], smallest_px: float = SMALLEST_PX) -> Iterator[MarkerCandidates]:
    """Yield where markers may be in a (H, W) image, `PAGE` at a time; the last, which may be empty, has fewer.

    Below the smallest filter the image is searched enlarged, unless it is a large one.
    """
    factor = int(np.ceil(np.sqrt(gray.size / _WHOLE_PIXELS)))
    if factor > 1:
        parts = [_reduced(gray, factor), *_in_strips(gray)]
    else:
        parts = [blob_rows(gray, THRESHOLD, LEAST_QUOTIENT)]
        parts += [_enlarged(gray, SMALLEST_PX / smallest_px)] if smallest_px < SMALLEST_PX else []
    rows = np.concatenate(parts)
    sides, quotients = SIDE_OF_SCALE * rows[:, 2], rows[:, 5]
    is_small = sides < _SMALL_PX * smallest_px / SMALLEST_PX
    is_one = (sides > smallest_px) & (~is_small | (quotients > _LEAST_OF_SMALL))
    yield from pages(rows[is_one], SIDE_OF_SCALE, gray.shape, _worth, PAGE, _ALIKE)


def pages(
    rows: NDArray[np.float64],
    side_of_scale: float,
    shape: tuple[int, ...],
    worth: Worth,
    length: int,
    alike: tuple[float, float],
) -> Iterator[MarkerCandidates]:
    """Yield key points (n, 6) of an image of a shape in pages of a length, by falling worth.

    Their columns are x, y, scale, response, sign and quotient; the worth is of (k,) responses and quotients. Of those
    that are alike, see `distinct_rows`, the one of the highest quotient remains.
    """
    rows = rows[np.argsort(-rows[:, 5], kind="stable")]
    distinct = rows[distinct_rows(rows, shape, *alike)]
    distinct = distinct[np.argsort(-worth(distinct[:, 3], distinct[:, 5]), kind="stable")]
    for first in range(0, len(distinct) + 1, length):
        page = distinct[first : first + length]
        sides, signs = side_of_scale * page[:, 2], page[:, 4].astype(np.int8)
        yield MarkerCandidates(page[:, :2], sides, signs, page[:, 3], page[:, 5])


def _worth(responses: NDArray[np.float64], quotients: NDArray[np.float64]) -> NDArray[np.float64]:
    return quotients + _BY_RESPONSE * np.log(responses)


def joined(pages: Sequence[MarkerCandidates]) -> MarkerCandidates:
    """Return several pages as one."""
    return MarkerCandidates(*(np.concatenate([getattr(page, f.name) for page in pages]) for f in fields(pages[0])))


def _reduced(gray: NDArray[np.uint8], factor: int) -> NDArray[np.float64]:
    """Return the blobs of an image's means of factor × factor pixels, in its own pixels."""
    height, width = (length // factor for length in gray.shape)
    whole = gray[: height * factor, : width * factor]
    small = np.asarray(cv2.resize(whole, (width, height), interpolation=cv2.INTER_AREA), dtype=np.uint8)
    return _scaled(blob_rows(small, THRESHOLD, LEAST_QUOTIENT), 1 / factor, 1 / factor)


def _enlarged(gray: NDArray[np.uint8], factor: float) -> NDArray[np.float64]:
    """Return the smallest blobs of an enlarged image, in the image's own pixels."""
    height, width = (max(1, round(factor * length)) for length in gray.shape)
    large = np.asarray(cv2.resize(gray, (width, height), interpolation=cv2.INTER_LINEAR), dtype=np.uint8)
    rows = blob_rows(large, THRESHOLD, LEAST_QUOTIENT, (0,), has_slanted=False)
    return _scaled(rows, width / gray.shape[1], height / gray.shape[0])


def _scaled(rows: NDArray[np.float64], across: float, down: float) -> NDArray[np.float64]:
    """Return blobs of an image that was scaled, in the pixels that it had before."""
    before = rows.copy()
    before[:, :2] = (rows[:, :2] + 0.5) / [across, down] - 0.5
    before[:, 2] = rows[:, 2] / np.sqrt(across * down)
    return before


def _in_strips(gray: NDArray[np.uint8]) -> Iterator[NDArray[np.float64]]:
    """Yield the square small blobs of strips of a large image."""
    for top, bottom in bands(gray.shape[0], -(-gray.shape[0] // _STRIP_ROWS)):
        first = max(0, top - _STRIP_MARGIN)
        strip = gray[first : bottom + _STRIP_MARGIN]
        rows = blob_rows(strip, THRESHOLD, LEAST_QUOTIENT, _SMALL_OCTAVES, has_slanted=False)
        rows[:, 1] += first
        yield rows[(rows[:, 1] >= top - 0.5) & (rows[:, 1] < bottom - 0.5)]


def distinct_rows(rows: NDArray[np.float64], shape: tuple[int, ...], near: float, like: float) -> NDArray[np.int64]:
    """Return which rows (n, 6), best first, are no other one found again, see `pages`.

    One found again has the sign of another one, is nearer to it than `near` scales and of less than `like` times its
    scale, or it of that.
    """
    kept, count = np.empty(len(rows), np.int64), np.empty(1, np.int64)
    _distinct_rows(rows, near, like, float(shape[1]), float(shape[0]), kept, count)
    return kept[: count[0]]
