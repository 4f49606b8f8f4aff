"""SURF's stages, alone and together; `peakmark.surf` names them."""

from numbers import Real
from typing import Final, TypedDict

import numpy as np
from numpy.typing import ArrayLike, NDArray

from peakmark.errors import InputError
from peakmark.keypoints.image import as_gray
from peakmark.keypoints.keypoints import Keypoints
from peakmark.surf.descriptor import describe_windows
from peakmark.surf.hessian import find_interest_points, strongest_first, to_keypoints
from peakmark.surf.integral import integral_image, padded_integral
from peakmark.surf.layers import Layer
from peakmark.surf.orientation import NO_SAMPLE, UPRIGHT_DEG, measure_angles
from peakmark.surf.stages import LayerResponse, hessian_responses, interest_points

__all__ = [
    "OPENCV",
    "PAPER",
    "LayerResponse",
    "describe",
    "detect",
    "detect_and_describe",
    "hessian_responses",
    "integral_image",
    "interest_points",
    "orientations",
]


class ScaleSpace(TypedDict):
    """A preset: `detect(gray, **PAPER)`."""

    octaves: int
    layers: int


PAPER: Final = ScaleSpace(octaves=4, layers=2)
"""Filter sides 15…195 px in two searched layers an octave, as in the marker paper."""
OPENCV: Final = ScaleSpace(octaves=4, layers=3)
"""OpenCV's default, and ours."""

_LARGEST_SIDE = 4767
"""Side of the largest filter whose sums fit 31 bits: 2 · 255 · (side / 3) · (5 side / 9) < 2^31."""
_SMALLEST, _LARGEST = 0.36, 4767.0
"""Sizes, px, whose windows have a pixel at least, and take 180 megabytes at most."""
_FARTHEST = 2.0**24
"""Coordinates beyond, px, are no whole pixels in single precision."""


def detect(
    image: ArrayLike,
    threshold: float = 100.0,
    octaves: int = 4,
    layers: int = 3,
    extended: bool = False,
    upright: bool = False,
    strongest: int | None = None,
    mask: ArrayLike | None = None,
) -> Keypoints:
    """Find SURF key points with their orientation, strongest first.

    Parameters
    ----------
    image : (H, W) grey or (H, W, 3) RGB, uint8, uint16 or floating point in 0…1; see `as_gray`.
    threshold : smallest determinant of the Hessian, (grey levels)², exclusive; at least 0.
    octaves : at least 1; octave o works on every 2^o-th pixel.
    layers : layers an octave in which maxima are sought, at least 1. `PAPER` and `OPENCV` are presets for both.
    extended : no effect here; so that one set of parameters serves `detect_and_describe` too.
    upright : do not measure the orientation: every angle is 270°, as OpenCV writes it.
    strongest : keep only so many key points (all are found, few are oriented); None keeps all.
    mask : (H, W) bool or uint8; a key point is kept where the pixel nearest to it and at least half of its filter
        square are nonzero, OpenCV's rule.

    Returns
    -------
    Keypoints
        Ordered by response, then larger size, larger octave, larger y, smaller x. `size` is rounded to an integer as
        OpenCV's is, `scale` is not. A key point without a single Haar sample inside the image is left out. Images too
        small for any filter, and uniform ones, give none.

    Raises
    ------
    InputError
        If an argument is not as stated, or a filter that fits into the image would exceed 4767 px.
    """
    gray = as_gray(image)
    _check_parameters(threshold, octaves, layers, strongest, gray.shape)
    chosen_pixels = None if mask is None else _as_zeros_and_ones(mask, gray.shape)
    covered = None if chosen_pixels is None else padded_integral(chosen_pixels)
    integral = padded_integral(gray)
    height, width = gray.shape
    records = find_interest_points(integral, (height, width), threshold, octaves, layers, covered)
    if chosen_pixels is not None:
        columns, rows = np.rint(records[:, :2]).astype(np.intp).T
        records = records[chosen_pixels[rows, columns] > 0]
    order = strongest_first(records)
    limit = len(order) if strongest is None else strongest
    if upright:
        return to_keypoints(records[order[:limit]], np.float32(UPRIGHT_DEG))
    chosen, angles = _orient_strongest(integral, (height, width), records, order, limit)
    return to_keypoints(records[chosen], angles)


def detect_and_describe(
    image: ArrayLike,
    threshold: float = 100.0,
    octaves: int = 4,
    layers: int = 3,
    extended: bool = False,
    upright: bool = False,
    strongest: int | None = None,
    mask: ArrayLike | None = None,
) -> Keypoints:
    """Find SURF key points and describe them; see `detect` and `describe` for the parameters."""
    gray = as_gray(image)
    keypoints = detect(gray, threshold, octaves, layers, extended, upright, strongest, mask)
    return keypoints.with_columns(descriptors=describe(gray, keypoints, extended, upright))


def orientations(integral: NDArray[np.int32], keypoints: Keypoints) -> NDArray[np.float32]:
    """Orientation of each key point from Haar responses within 6 s, s = 1.2 size / 9.

    Parameters
    ----------
    integral : (H + 1, W + 1) int32 array of `integral_image`.
    keypoints : key points of that image; their angles are not read.

    Returns
    -------
    (n,) float32 degrees, 0…360; −1 where no Haar filter fits into the image.
    """
    shape = (integral.shape[0] - 1, integral.shape[1] - 1)
    _check_keypoints(keypoints)
    return measure_angles(np.ascontiguousarray(integral), shape, keypoints.xy, keypoints.size)


def describe(
    image: ArrayLike, keypoints: Keypoints, extended: bool = False, upright: bool = False
) -> NDArray[np.float32]:
    """Describe the surroundings of key points by their gradients.

    Parameters
    ----------
    image : as in `detect`.
    keypoints : positions, sizes and angles of any detector; the window's side is trunc(21 · 1.2 size / 9) px.
    extended : 128 entries instead of 64, sums split by the other gradient's sign.
    upright : take the window upright (rows of the patch run up the image, as OpenCV does), whatever the angle.

    Returns
    -------
    (n, 64) or (n, 128) float32, each row of unit length, or zero for a uniform window. An entry quadruple of a cell is
    Σdx, Σdy, Σ|dx|, Σ|dy|, the cells row by row.

    Raises
    ------
    InputError
        If the image is not as stated, or a key point's position, size (0.36…4767 px) or angle cannot be used.
    """
    gray = as_gray(image)
    _check_keypoints(keypoints)
    return describe_windows(gray, keypoints.xy, keypoints.size, keypoints.angle, extended, upright)


def _orient_strongest(
    integral: NDArray[np.int32],
    shape: tuple[int, int],
    records: NDArray[np.float32],
    order: NDArray[np.intp],
    limit: int,
) -> tuple[NDArray[np.intp], NDArray[np.float32]]:
    """The first `limit` rows in `order` that have an orientation, and that orientation."""
    tried = limit
    while True:
        head = order[:tried]
        angles = np.empty(len(records), dtype=np.float32)
        rows = np.sort(head)  # records lie in image order, which is kinder to the cache
        angles[rows] = measure_angles(integral, shape, records[rows, :2], records[rows, 3])
        chosen = head[angles[head] != NO_SAMPLE][:limit]
        if len(chosen) == limit or tried >= len(order):
            return chosen, angles[chosen]
        tried *= 2


def _check_parameters(
    threshold: float, octaves: int, layers: int, strongest: int | None, shape: tuple[int, ...]
) -> None:
    if not (isinstance(threshold, Real) and 0 <= threshold < np.inf):
        raise InputError(f"threshold: expected a finite number of at least 0, got {threshold!r}")
    for name, value, most in (("octaves", octaves, 16), ("layers", layers, 64)):
        if not (isinstance(value, int | np.integer) and 1 <= value <= most):
            raise InputError(f"{name}: expected an integer in 1…{most}, got {value!r}")
    if strongest is not None and not (isinstance(strongest, int | np.integer) and strongest >= 0):
        raise InputError(f"strongest: expected None or an integer of at least 0, got {strongest!r}")
    sides = (Layer(octave, index).side for octave in range(octaves) for index in range(layers + 2))
    largest = max((side for side in sides if side <= min(shape)), default=0)
    if largest > _LARGEST_SIDE:
        raise InputError(f"octaves, layers: expected filters of at most {_LARGEST_SIDE} px, got {largest}")


def _check_keypoints(keypoints: Keypoints) -> None:
    """Refuse key points whose window is empty, too large, or nowhere."""
    limits = {"xy": (-_FARTHEST, _FARTHEST), "size": (_SMALLEST, _LARGEST), "angle": (-360.0, 360.0)}
    for name, (least, most) in limits.items():
        column = getattr(keypoints, name)
        outside = ~((column >= least) & (column <= most))
        if outside.any():
            raise InputError(f"keypoints.{name}: expected values in {least:g}…{most:g}, got {column[outside][0]}")


def _as_zeros_and_ones(mask: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.uint8]:
    chosen = np.asarray(mask)
    if chosen.shape != shape or chosen.dtype not in (np.bool_, np.uint8):
        raise InputError(f"mask: expected a bool or uint8 array of shape {shape}, got {chosen.dtype} {chosen.shape}")
    return np.asarray(chosen != 0, dtype=np.uint8)
