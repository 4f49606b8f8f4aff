"""Signatures: the inner four cells of a SURF descriptor, which carry the marker (paper, Sections 3.2 and 4.2)."""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from peakmark import surf
from peakmark.errors import InputError
from peakmark.keypoints.keypoints import Keypoints
from peakmark.markers.patterns import Polarity, plain_ground, surf_marker

INNER_CELLS = np.array([5, 6, 9, 10])
"""Row-major indices of the inner 2×2 of the 4×4 cells; each cell is Σdx, Σdy, Σ|dx|, Σ|dy|."""

SIGNATURE = (4 * INNER_CELLS[:, None] + np.arange(4)).ravel()
"""The 16 descriptor dimensions (0-based) of the signature."""

VERSION_INDEPENDENT = (4 * INNER_CELLS[:, None] + np.array([2, 3])).ravel()
"""The 8 dimensions (0-based) that light and dark markers share: the paper's 23, 24, 27, 28, 39, 40, 43, 44 from 1."""

_REFERENCE_SIDE_PX = 147
_REFERENCE_IMAGE_PX = 513


def signature_distances(descriptors: NDArray[np.float32], polarity: Polarity | None = "dark") -> NDArray[np.float32]:
    """Return the Euclidean distances of (n, 64) descriptors from the ideal marker's signature.

    Without a polarity the version-independent signature (VIS) is compared, which is common to both. Extended
    descriptors have other cells, and are refused with an `InputError`.
    """
    if descriptors.ndim != 2 or descriptors.shape[1] != 64:
        raise InputError(f"descriptors: expected (n, 64), got {descriptors.shape}")
    dimensions = VERSION_INDEPENDENT if polarity is None else SIGNATURE
    reference = reference_descriptor(polarity or "dark")[dimensions]
    return np.asarray(np.linalg.norm(descriptors[:, dimensions] - reference, axis=1), dtype=np.float32)


@cache
def reference_descriptor(polarity: Polarity, is_on_paper: bool = False) -> NDArray[np.float32]:
    """Return the (64,) descriptor that our own detector computes on the ideal marker, seen squarely.

    Around it is the plain ground of Section 4.1's experiments (`plain_ground`), or white as on paper: the same for a
    dark marker, while the dark rim of a light one ends in an edge there, which the inner cells see. The entries that
    the paper calls identical differ by 0.035 between a dark marker and its negative, and by 0.24 from a light one on
    white.

    The marker's four-fold symmetry makes its dominant gradient lie at ±27° from an axis however it is
    rotated, so that one reference serves all.
    """
    strongest: Keypoints = surf.detect_and_describe(_ideal_view(polarity, is_on_paper), strongest=1)
    assert strongest.descriptors is not None
    descriptor = strongest.descriptors[0].copy()
    descriptor.setflags(write=False)
    return np.asarray(descriptor)


def _ideal_view(polarity: Polarity, is_on_paper: bool) -> NDArray[np.uint8]:
    """Return the set-up of Section 4.1: the marker centred on a plain 513×513 image."""
    marker = surf_marker(_REFERENCE_SIDE_PX, polarity)
    margin = (_REFERENCE_IMAGE_PX - _REFERENCE_SIDE_PX) // 2
    return np.pad(marker, margin, constant_values=255 if is_on_paper else plain_ground(polarity))


def polarity_by_signature(descriptors: NDArray[np.float32]) -> list[Polarity]:
    """Return for each of (n, 64) descriptors the polarity whose ideal signature, printed on paper, is nearer."""
    dark, light = (
        np.linalg.norm(descriptors[:, SIGNATURE] - reference_descriptor(polarity, is_on_paper=True)[SIGNATURE], axis=1)
        for polarity in ("dark", "light")
    )
    return ["dark" if d < li else "light" for d, li in zip(dark, light, strict=True)]
