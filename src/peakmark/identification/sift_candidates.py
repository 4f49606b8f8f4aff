"""Where SIFT markers may be: extremes of the DoG over positions and scales, by their share of what variance allows.

They are SIFT's (Lowe 2004, doi:10.1023/B:VISI.0000029664.99615.94): three scales an octave, extremes among 26
neighbours. OpenCV's own list leaves out one marker in eight, those whose scale lies between two layers, for its
interpolation then steps to and fro and gives up; and it has no sign. An octave more of small scales replaces the image
of twice the size.
"""

from collections.abc import Iterator
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray
from peaksim.native import function

from peakmark.detectors.dog import dog_responses
from peakmark.detectors.vlfeat import vlfeat_sift
from peakmark.identification.alignment import noise_sigma_of
from peakmark.identification.candidates import MarkerCandidates, pages
from peakmark.identification.evidence import box_variance
from peakmark.markers.patterns import SIFT_SIDE_IN_SIGMA, sift_marker
from peakmark.parallel import map_parallel

SIDE_OF_SIGMA = SIFT_SIDE_IN_SIGMA * np.sqrt(2)
"""Side of a DoG marker over its key point's σ, and of a disc √2 less."""

LEAST_RESPONSE, LEAST_SIGMAS = 0.006, 5.0
"""DoG of a candidate, grey levels 0…1 (OpenCV's default is 0.013), and over that of the image's noise."""

LEAST_QUOTIENT = 0.45
"""Share of the largest DoG at this variance from which a key point is a candidate."""

SMALLEST_PX = 10.0
"""Side of the smallest candidates."""

_LAYERS, _SIGMA, _OWN_SIGMA = 3, 1.6, 0.5
"""Scales an octave, SIFT's σ, and that which an image is thought to have."""

_FIRST, _SMALLEST, _LARGEST = -4, -3, 3
"""Scales over SIFT's σ, in steps of the layers: the least of the image itself, and that of its halves, which begin
before SIFT's, for a place is told between pixels here; and the largest. Octaves have a scale in common, for what lies
between two may be an extreme of neither."""

_CROSS = ((0, 0), (-1, 0), (1, 0), (0, -1), (0, 1))
"""A pixel and its neighbours left, right, above and below."""

_NOISE_OF_DOG = 0.0817
"""Deviation of the DoG of noise of σ 1, times the scale: √((1 + k⁻² − 4 / (1 + k²)) / 4π), k = 2^⅓."""

_PAGE = 2000
"""Candidates that are looked at together: small ones are many, and a correlation with a round pattern takes little."""

_ALIKE = (0.12, 1.2)
"""Key points of one sign this near, in scales, and this like in scale, are one candidate."""

_NARROW = 0.3
"""Variance of a blur, px², below which a sampled Gaussian is too narrow by a fifth or more."""

_ROOM = 20_000
"""Extremes of an octave for which there is room at first."""

_BOX = 6.0
"""Side of the box whose variance is compared, σ."""

_dog_extremes = function(
    "void dog_extremes(const f4[layers,height,width] blurs, f8 least_size, i4[room,4] found, i8[1] count)"
)


def sift_candidate_pages(gray: NDArray[np.uint8]) -> Iterator[MarkerCandidates]:
    """Yield where SIFT markers may be in a (H, W) image; see `candidates.candidate_pages`."""
    yield from pages_of(gray, dog_extremes(gray))


def vlfeat_candidate_pages(gray: NDArray[np.uint8]) -> Iterator[MarkerCandidates]:
    """Yield VLFeat's key points in a (H, W) image as candidates; without pycolmap an `InputError` says so."""
    points = vlfeat_sift(gray, describe=False)
    columns = (points.xy, points.size / 2, points.response * points.laplacian)
    yield from pages_of(gray, np.column_stack(columns).astype(np.float64))


def pages_of(gray: NDArray[np.uint8], points: NDArray[np.float64]) -> Iterator[MarkerCandidates]:
    """Yield key points (n, 4), x, y, σ and signed DoG, as candidates."""
    noise = noise_sigma_of(gray) / 255 * _NOISE_OF_DOG / points[:, 2]
    points = points[(SIDE_OF_SIGMA * points[:, 2] > SMALLEST_PX) & (np.abs(points[:, 3]) > LEAST_SIGMAS * noise)]
    xy, sigma, response = points[:, :2], points[:, 2], points[:, 3]
    variance = box_variance(gray, xy.astype(np.float32), np.column_stack([sigma, sigma]) * _BOX) / 255**2
    quotient = np.abs(response) / (_most_response() * np.sqrt(np.maximum(variance, 1e-5)))
    found = np.column_stack([xy, sigma, np.abs(response), np.sign(response), quotient])
    yield from pages(found[quotient > LEAST_QUOTIENT], float(SIDE_OF_SIGMA), gray.shape, sift_worth, _PAGE, _ALIKE)


def sift_worth(responses: NDArray[np.float64], quotients: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return what (n,) candidates' answers are worth beside a correlation.

    0.03 for each doubling of the response, for small faint blobs are many and look like any round pattern; and 0.2 of
    the quotient up to 0.95, which markers reach and half of all clutter does not. Of markers on floors of the training
    split one in a hundred is behind 55 others, and without the latter behind 75.
    """
    contrast = np.log2(np.clip(responses, 0.005, 0.1) / 0.1)
    return np.asarray(0.03 * contrast + 0.2 * np.minimum(quotients, 0.95))


def dog_extremes(gray: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Return (n, 4) x, y, σ, px, and signed DoG, grey levels 0…1, of the extremes in an image; dark centres are +."""
    base = np.divide(gray, 255, dtype=np.float32)
    found, step, own_sigma, first = [np.empty((0, 4))], 1.0, _OWN_SIGMA, _FIRST
    while min(base.shape) >= 12:
        sigmas = _SIGMA * 2 ** (np.arange(first, _LARGEST + 1) / _LAYERS)
        blurs = _blurs(base, own_sigma, sigmas)
        found.append(_extremes(blurs, sigmas) * [step, step, step, 1.0])
        base = np.ascontiguousarray(blurs[-first, ::2, ::2])
        step, own_sigma, first = 2 * step, _SIGMA / 2, _SMALLEST
    return np.concatenate(found)


def _blurs(base: NDArray[np.float32], own_sigma: float, sigmas: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return (n, H, W) an image blurred to each σ."""
    blurs = np.empty((len(sigmas), *base.shape), np.float32)
    map_parallel(lambda k: blur(base, own_sigma, float(sigmas[k]), blurs[k]), range(len(sigmas)))
    return blurs


def blur(base: NDArray[np.float32], own_sigma: float, sigma: float, result: NDArray[np.float32]) -> None:
    """Fill in an image of its own blur `own_sigma`, px, blurred to `sigma`."""
    variance = max(float(sigma**2 - own_sigma**2), 1e-3)
    if variance < _NARROW:  # samples of a narrow Gaussian have half of its variance, three taps have it
        taps = np.array([variance / 2, 1 - variance, variance / 2])
        cv2.sepFilter2D(base, -1, taps, taps, dst=result)
    else:
        cv2.GaussianBlur(base, (0, 0), np.sqrt(variance), dst=result)


def _extremes(blurs: NDArray[np.float32], sigmas: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return (n, 4) of one octave, dark ones first; places, σ and size by parabolas through neighbours."""
    rows, count = np.empty((_ROOM, 4), np.int32), np.empty(1, np.int64)
    _dog_extremes(blurs, LEAST_RESPONSE, rows, count)
    if count[0] > _ROOM:
        rows = np.empty((count[0], 4), np.int32)
        _dog_extremes(blurs, LEAST_RESPONSE, rows, count)
    rows = rows[: count[0]]
    k, y, x, sign = rows[np.argsort(-rows[:, 3], kind="stable")].T
    height, width = blurs.shape[1:]

    def dog(up: int, right: int, down: int) -> NDArray[np.float64]:
        row, column = np.clip(y + down, 0, height - 1), np.clip(x + right, 0, width - 1)
        return np.asarray(sign * (blurs[k + up + 1, row, column] - blurs[k + up, row, column]).astype(np.float64))

    layers = [_peak(*(dog(up, *away) for away in _CROSS)) for up in (-1, 0, 1)]
    larger = _step(*(layer[2] for layer in layers))
    right, down, most = layers[1]
    return np.column_stack([x + right, y + down, sigmas[k] * 2 ** (larger / _LAYERS), sign * most])


def _step(less: NDArray[np.float64], most: NDArray[np.float64], more: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return (n,) where the parabola through three values is largest, −½…½."""
    return np.asarray(np.clip((less - more) / np.minimum(2 * (less - 2 * most + more), -1e-9), -0.5, 0.5))


def _peak(most: NDArray[np.float64], *around: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
    """Return (n,) right, down and value of the parabola's top, from values at a pixel, left, right, above and below."""
    left, right, above, below = around
    x, y = _step(left, most, right), _step(above, most, below)
    return x, y, most + (right - left) / 4 * x + (below - above) / 4 * y


@cache
def _most_response() -> float:
    """Return the DoG at the marker's own key point over the levels' deviation in the box."""
    sigma = 20.0
    marker = sift_marker(sigma * np.sqrt(2), round(SIDE_OF_SIGMA * sigma))
    middle = (len(marker) - 1) / 2
    response = float(dog_responses(marker, [[middle, middle]], [sigma])[0])
    box = np.array([[_BOX * sigma, _BOX * sigma]])
    return float(
        response / (np.sqrt(float(box_variance(marker, np.array([[middle, middle]], np.float32), box)[0])) / 255)
    )
