"""What is known of a key point that may be a marker: response, signature, size, and its alignment with the pattern."""

from functools import cache

import numpy as np
from numpy.typing import NDArray
from peaksim.native import function

from peakmark.identification.signature import signature_distances
from peakmark.identification.stretch import Stretch
from peakmark.keypoints.keypoints import Keypoints
from peakmark.markers.optimum import quadratic_optimum
from peakmark.markers.patterns import surf_filters, surf_form
from peakmark.refine.api import Refined

_box_variances = function("void box_variances(const u1[height,width] gray, const i8[n,4] boxes, f8[n] variances)")


def aligned_evidence(
    quotients: NDArray[np.float64], distances: NDArray[np.float64], refined: Refined, least_unexplained: float
) -> NDArray[np.float64]:
    """Return (n, 4) columns: quotient, signature distance, −log of the unexplained share, blur in sides.

    An alignment that did not converge explains nothing, and its blur counts as a side. Unexplained shares below
    `least_unexplained` count as this.
    """
    unexplained = np.maximum(1 - refined.explained, least_unexplained)
    with np.errstate(invalid="ignore"):
        blur = np.where(refined.converged, refined.blur_px / refined.side_px, 1.0)
    return np.column_stack([quotients, distances, -np.log(unexplained), blur])


def response_quotients(gray: NDArray[np.uint8], features: Keypoints, stretch: Stretch) -> NDArray[np.float64]:
    """Return (n,) responses over the largest that any image of the same variance under the filter can give, 0…1.

    The marker is the pattern that maximises this Rayleigh quotient (paper, Section 3.2), so it tells a dim marker from
    a strong edge. Sub-pixel sizes and interpolation can lift it a little above 1.
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
    limits = np.array(gray.shape[::-1])
    low, high = (np.clip(np.rint(centers + sign * sizes / 2 + 0.5), 0, limits).astype(np.int64) for sign in (-1, 1))
    high = np.maximum(high, np.minimum(low + 1, limits))
    variances = np.empty(len(low))
    _box_variances(np.ascontiguousarray(gray), np.column_stack([low, high]), variances)
    return variances


def feature_evidence(gray: NDArray[np.uint8], features: Keypoints) -> NDArray[np.float64]:
    """Return the (n, len(COLUMNS)) columns that a classifier weighs, of key points of an unstretched image."""
    assert features.descriptors is not None
    response = np.maximum(features.response.astype(np.float64), 1e-6)
    return np.column_stack(
        [
            np.log10(response),
            signature_distances(features.descriptors, None),
            np.log10(features.scale.astype(np.float64)),
            response_quotients(gray, features, 1.0),
        ]
    )
