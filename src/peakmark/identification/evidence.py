"""What is known of a key point that may be a marker: response, signature, size, and its alignment with the pattern."""

from functools import cache

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from peakmark.identification.signature import signature_distances
from peakmark.identification.stretch import Stretch
from peakmark.keypoints.keypoints import Keypoints
from peakmark.markers.optimum import quadratic_optimum
from peakmark.markers.patterns import surf_filters, surf_form
from peakmark.refine.api import Refined

APART = 0.6
"""Markers nearer than so many sides are one marker found twice."""


def aligned_evidence(
    shares: NDArray[np.float64], distances: NDArray[np.float64], refined: Refined, least_unexplained: float
) -> NDArray[np.float64]:
    """Return (n, 4) columns: quotient, signature distance, −log of the unexplained share, blur in sides.

    Parameters
    ----------
    shares
        (n,) see `quotients`.
    distances
        (n,) signature distances.
    refined
        The alignment of each; one that did not converge explains nothing, and its blur counts as a side.
    least_unexplained
        Unexplained shares below this count as this.
    """
    unexplained = np.maximum(1 - refined.explained, least_unexplained)
    with np.errstate(invalid="ignore"):
        blur = np.where(refined.converged, refined.blur_px / refined.side_px, 1.0)
    return np.column_stack([shares, distances, -np.log(unexplained), blur])


def quotients(gray: NDArray[np.uint8], features: Keypoints, stretch: Stretch) -> NDArray[np.float64]:
    """Return (n,) responses over the largest that a picture of the same variance under the filter can give, 0…1.

    Sub-pixel sizes and interpolation can lift it a little above 1.
    """
    factor = np.asarray(stretch, dtype=np.float64)
    if factor.ndim:
        factor = factor[np.clip(np.rint(features.xy[:, 1]), 0, len(factor) - 1).astype(np.intp)]
    across = features.scale * np.sqrt(factor)
    variance = box_variance(gray, features.xy, np.column_stack([across, across / factor]))
    return np.asarray(features.response / (best_response() * np.maximum(variance, 1e-3)))


@cache
def best_response() -> float:
    """Return the largest determinant per unit of variance under the filter: the eigenvalue of the marker, 19.19."""
    filters = surf_filters()
    return float(quadratic_optimum(filters, surf_form(), "energy").bound * filters[0].size)


def box_variance(
    gray: NDArray[np.uint8], centers: NDArray[np.float32], sizes: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return (n,) variances of the grey levels in boxes of (n, 2) widths and heights, cut at the border."""
    sums, squares = cv2.integral2(gray, sdepth=cv2.CV_64F, sqdepth=cv2.CV_64F)
    limits = np.array(gray.shape[::-1])
    low, high = (np.clip(np.rint(centers + sign * sizes / 2 + 0.5), 0, limits).astype(np.intp) for sign in (-1, 1))
    high = np.maximum(high, np.minimum(low + 1, limits))
    count = np.maximum((high - low).prod(axis=1), 1)
    mean, mean_square = (_box_sums(np.asarray(table), low, high) / count for table in (sums, squares))
    return np.asarray(np.maximum(mean_square - mean**2, 0.0))


def _box_sums(table: NDArray[np.float64], low: NDArray[np.intp], high: NDArray[np.intp]) -> NDArray[np.float64]:
    (x0, y0), (x1, y1) = low.T, high.T
    return np.asarray(table[y1, x1] - table[y0, x1] - table[y1, x0] + table[y0, x0])


def one_each(xy: NDArray[np.float64], sides: NDArray[np.float64], worth: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return the rows, best first, that are not within `APART` sides of a better one."""
    order = np.argsort(-worth, kind="stable")
    return np.asarray(order[_is_kept(xy[order], sides[order], APART)])


@njit(cache=True, nogil=True)
def _is_kept(xy, sides, apart):
    """Return (n,) whether each, in this order, is farther than `apart` sides from all before it that are kept."""
    kept = np.empty(len(xy), np.intp)
    is_kept = np.zeros(len(xy), np.bool_)
    count = 0
    for i in range(len(xy)):
        is_kept[i] = True
        for k in kept[:count]:
            x, y = xy[k, 0] - xy[i, 0], xy[k, 1] - xy[i, 1]
            if not np.sqrt(x * x + y * y) > apart * max(sides[k], sides[i]):
                is_kept[i] = False
                break
        if is_kept[i]:
            kept[count] = i
            count += 1
    return is_kept


def evidence(gray: NDArray[np.uint8], features: Keypoints) -> NDArray[np.float64]:
    """Return the (n, len(COLUMNS)) columns of key points with descriptors, found in an unstretched picture."""
    assert features.descriptors is not None
    response = np.maximum(features.response.astype(np.float64), 1e-6)
    return np.column_stack(
        [
            np.log10(response),
            signature_distances(features.descriptors, None),
            np.log10(features.scale.astype(np.float64)),
            quotients(gray, features, 1.0),
        ]
    )
