"""Where markers may be: SURF on the image and on copies of it squeezed along four directions, by response quotient.

A steep marker is a narrow blob, to which SURF's square filters hardly answer; stretched by two along its narrow
direction it is round again. The copies keep the image's area. They are sampled between pixels, which also breaks the
ties of a clean marker that lies exactly between samples.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields

import cv2
import numpy as np
from numpy.typing import NDArray
from peaksim.native import function

from peakmark.identification.detection import SIDE_OF_SCALE
from peakmark.identification.evidence import best_response, box_variance
from peakmark.parallel import map_parallel
from peakmark.surf.hessian import find_interest_points
from peakmark.surf.integral import padded_integral

THRESHOLD = 300.0
"""Hessian threshold; 100, 300 and 500 find the same markers of 20 px and more."""

LEAST_QUOTIENT = 0.14
"""Response quotient from which a key point is a candidate."""

SMALLEST_PX = 10.0
"""Side of the smallest candidates."""

PAGE = 500
"""Candidates that are looked at together, by falling quotient."""

DIRECTIONS_DEG = (0.0, 45.0, 90.0, 135.0)
_PAD_SHARE = 0.05
_NEAR, _LIKE = 0.12, 1.2
"""Key points of one sign this near, in scales, and this like in scale, are one candidate."""

_COPIED_PIXELS = 1_500_000
"""Larger images are searched in copies of about this size, too; their own pixels only unsqueezed."""

_distinct_rows = function(
    "status distinct_rows(const f8[n,6] found, f8 near, f8 like, f8 width, f8 height, i8[n] kept, i8[1] count)"
)


Worth = Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]]


@dataclass(frozen=True)
class MarkerCandidates:
    """Positions at which a marker may be, by falling quotient."""

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

    Below SURF's own smallest filter the image is searched enlarged, unless it is a large one.
    """
    scale = min(1.0, np.sqrt(_COPIED_PIXELS / gray.size))
    copies = [(np.eye(2), 5, 5)]
    copies += [(np.eye(2) * scale, 5, 5)] if scale < 0.7 else []
    copies += [(squeeze(angle) * scale, 4, 3) for angle in DIRECTIONS_DEG]
    is_enlarged = smallest_px < SMALLEST_PX and scale == 1
    copies += [(np.eye(2) * SMALLEST_PX / smallest_px, 1, 5)] if is_enlarged else []
    pad = round(_PAD_SHARE * max(gray.shape))
    padded = cv2.copyMakeBorder(gray, pad, pad, pad, pad, cv2.BORDER_REPLICATE)
    found = map_parallel(lambda copy: _search(gray, np.asarray(padded), pad, smallest_px, *copy), copies)
    yield from pages(np.concatenate(found), SIDE_OF_SCALE, gray.shape)


def pages(
    rows: NDArray[np.float64],
    side_of_scale: float,
    shape: tuple[int, ...],
    worth: Worth | None = None,
    length: int = PAGE,
) -> Iterator[MarkerCandidates]:
    """Yield key points (n, 6) of an image of a shape in pages of a length, by falling worth, or quotient.

    Their columns are x, y, scale, response, sign and quotient; the worth is of (k,) responses and quotients.
    """
    rows = rows[np.argsort(-rows[:, 5], kind="stable")]
    distinct = rows[distinct_rows(rows, shape, _NEAR, _LIKE)]
    if worth is not None:
        distinct = distinct[np.argsort(-worth(distinct[:, 3], distinct[:, 5]), kind="stable")]
    for first in range(0, len(distinct) + 1, length):
        page = distinct[first : first + length]
        sides, signs = side_of_scale * page[:, 2], page[:, 4].astype(np.int8)
        yield MarkerCandidates(page[:, :2], sides, signs, page[:, 3], page[:, 5])


def joined(pages: Sequence[MarkerCandidates]) -> MarkerCandidates:
    """Return several pages as one."""
    return MarkerCandidates(*(np.concatenate([getattr(page, f.name) for page in pages]) for f in fields(pages[0])))


def squeeze(angle_deg: float) -> NDArray[np.float64]:
    """Return (2, 2) what stretches by √2 across a direction, shrinks by √2 along it, and leaves rows upright.

    A rotation comes last, so that rows stay rows: a copy then fills three quarters of the room that it would take.
    """
    c, s = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    rotation = np.array([[c, -s], [s, c]])
    upright = np.linalg.qr(rotation @ np.diag([np.sqrt(0.5), np.sqrt(2.0)]) @ rotation.T)[1]
    return np.asarray(np.sign(np.diag(upright))[:, None] * upright)


def _search(
    gray: NDArray[np.uint8],
    padded: NDArray[np.uint8],
    pad: int,
    smallest_px: float,
    matrix: NDArray[np.float64],
    octaves: int,
    layers: int,
) -> NDArray[np.float64]:
    """Return (k, 6) x, y, scale, response, sign and quotient of the key points of one copy, in the image's pixels."""
    height, width = gray.shape
    copy, shift = _warped(padded, matrix)
    inverse = np.asarray(np.linalg.inv(matrix), dtype=np.float64)
    spans = _spans(copy.shape, inverse, -(inverse @ shift) - pad, (height, width))
    points = find_interest_points(padded_integral(copy), copy.shape, THRESHOLD, octaves, layers, None, spans)
    own_scale, response, sign = points[:, [2, 4, 6]].astype(np.float64).T
    xy = (points[:, :2].astype(np.float64) - shift) @ inverse.T - pad
    scale = own_scale / np.sqrt(np.abs(np.linalg.det(matrix)))
    inside = ((xy > -0.5) & (xy < np.array([width, height]) - 0.5)).all(axis=1)
    rows = np.flatnonzero(inside & (SIDE_OF_SCALE * scale > smallest_px))
    explained = response[rows] / best_response()
    sizes = np.repeat(own_scale[rows, None], 2, axis=1)
    variance = box_variance(copy, points[rows, :2], sizes, np.maximum(explained / LEAST_QUOTIENT, 1e-3))
    quotients = explained / np.maximum(variance, 1e-3)
    found = np.column_stack([xy[rows], scale[rows], response[rows], sign[rows], quotients])
    return np.asarray(found[quotients > LEAST_QUOTIENT])


def _spans(
    copy_shape: tuple[int, ...], inverse: NDArray[np.float64], origin: NDArray[np.float64], shape: tuple[int, int]
) -> NDArray[np.int32]:
    """Return (h, 2) first column, and one behind the last, that an image of a shape has in each row of its copy.

    A pixel (x, y) of the copy is the image's at `inverse` (x, y) + `origin`; rows without any end before they begin.
    """
    at_first_column = np.arange(copy_shape[0])[:, None] * inverse[:, 1] + origin
    limits = np.array([[-0.5, -0.5], [shape[1] - 0.5, shape[0] - 0.5]])[:, None]
    with np.errstate(divide="ignore"):
        crossed = np.sort((limits - at_first_column) / inverse[:, 0], axis=0)
    first, last = crossed[0].max(axis=1), crossed[1].min(axis=1)
    spans = np.column_stack([np.floor(first), np.ceil(last) + 1])
    return np.asarray(np.clip(spans, 0, copy_shape[1]), dtype=np.int32)


def _warped(image: NDArray[np.uint8], matrix: NDArray[np.float64]) -> tuple[NDArray[np.uint8], NDArray[np.float64]]:
    """Return the image under a linear map, and the shift that puts all of it into view."""
    if np.array_equal(matrix, np.eye(2)):
        return image, np.zeros(2)
    height, width = image.shape
    corners = np.array([[0, 0], [width, 0], [width, height], [0, height]]) - 0.5
    moved = corners @ matrix.T
    low = moved.min(axis=0)
    size = np.maximum(np.rint(moved.max(axis=0) - low).astype(int), 1)
    shift = -low - 0.5
    smooth = cv2.INTER_AREA if np.linalg.det(matrix) < 0.5 else cv2.INTER_LINEAR
    affine = np.column_stack([matrix, shift])
    copy = cv2.warpAffine(image, affine, (int(size[0]), int(size[1])), flags=smooth, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(copy), shift


def distinct_rows(rows: NDArray[np.float64], shape: tuple[int, ...], near: float, like: float) -> NDArray[np.int64]:
    """Return which rows (n, 6), best first, are no other one found again, see `pages`.

    One found again has the sign of another one, is nearer to it than `near` scales and of less than `like` times its
    scale, or it of that.
    """
    kept, count = np.empty(len(rows), np.int64), np.empty(1, np.int64)
    _distinct_rows(rows, near, like, float(shape[1]), float(shape[0]), kept, count)
    return kept[: count[0]]
