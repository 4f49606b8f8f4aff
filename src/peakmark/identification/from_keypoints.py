"""Markers among key points, without the image: SIFT's by their descriptors, SURF's by the paper's rule."""

from collections.abc import Callable
from dataclasses import replace
from itertools import product
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from peakmark.detectors.colmap import from_colmap
from peakmark.detectors.registry import as_keypoints
from peakmark.errors import InputError, check_choice
from peakmark.identification.detection import Detection, unrefined_detections
from peakmark.identification.paper import select_markers
from peakmark.identification.sift_candidates import SIDE_OF_SIGMA
from peakmark.identification.sift_signature import SIGNATURE, sift_views
from peakmark.identification.signature import polarity_by_signature, signature_distances
from peakmark.identification.suppression import suppress_non_maxima
from peakmark.keypoints.keypoints import Keypoints
from peakmark.markers.optimum import Limit
from peakmark.markers.patterns import Polarity, Variant

Wanted = Polarity | Literal["both"]
Described = tuple[Keypoints, NDArray[np.float32]]

SIFT_LIMIT = 0.4
"""Distance of descriptors of length 1 up to which a key point of SIFT is a marker's. Set by hand: markers to 55° are
below 0.35, what is around them above 0.35, and other key points of photographs above 0.47."""

_SIFT, _SURF = 128, 64


def identify_keypoints(
    keypoints: Any,
    descriptors: ArrayLike | None = None,
    polarity: Wanted = "both",
    limit: Limit | Literal["both"] = "energy",
    root: bool | None = None,
) -> tuple[Detection, ...]:
    """Return the markers among an image's key points, from key points and descriptors alone.

    Parameters
    ----------
    keypoints
        `Keypoints`, a sequence of `cv2.KeyPoint`, or a COLMAP database's (n, 4) or (n, 6) array: x, y with centres of
        pixels at +½, and scale and angle, or the affinity. SURF's need their responses.
    descriptors
        (n, 128) of SIFT or (n, 64) of SURF, of any number type and length; those of `keypoints` unless given.
    polarity
        Which markers to look for.
    limit
        Of a SIFT marker: "energy" the DoG, "range" the disc, or "both". SURF's descriptors tell no limit.
    root
        Whether SIFT's descriptors are RootSIFT (Arandjelović & Zisserman 2012, doi:10.1109/CVPR.2012.6248018); unless
        given they are what makes more of a marker of some of them.

    Returns
    -------
    tuple
        The likeliest first. `rank` is the key point's row, from 1; `size` the side of the marker that has its scale;
        nothing is refined. SURF's come by the paper's rule, see `identification.paper`, and need markers in view.

    Raises
    ------
    InputError
        If there are no descriptors, or they are not as many as key points, of another length, not finite numbers, or
        below 0 of SIFT, or a choice is unknown.
    """
    check_choice(polarity, (*get_args(Polarity), "both"), "polarity")
    check_choice(limit, (*get_args(Limit), "both"), "limit")
    if not (root is None or isinstance(root, bool)):
        raise InputError(f"root: expected True, False or None, got {root!r}")
    points, vectors = _described(keypoints, descriptors)
    wanted: tuple[Polarity, ...] = get_args(Polarity) if polarity == "both" else (polarity,)
    limits: tuple[Limit, ...] = get_args(Limit) if limit == "both" else (limit,)
    find: dict[int, Callable[[], tuple[Detection, ...]]] = {
        _SIFT: lambda: _of_sift(points, vectors, [Variant(*one, "sift") for one in product(wanted, limits)], root),
        _SURF: lambda: _of_surf(points, vectors, wanted),
    }
    if vectors.shape[1] not in find:
        raise InputError(f"descriptors: expected (n, 128) of SIFT or (n, 64) of SURF, got {vectors.shape}")
    return find[vectors.shape[1]]() if len(points) else ()


def _described(keypoints: Any, descriptors: ArrayLike | None) -> Described:
    """Return key points with sizes, and descriptors, checked."""
    points = from_colmap(keypoints) if isinstance(keypoints, np.ndarray) else as_keypoints(keypoints, "keypoints")
    given = points.descriptors if descriptors is None else descriptors
    if given is None:
        raise InputError("descriptors: expected (n, 128) of SIFT or (n, 64) of SURF, got none")
    vectors = _numbers(given)
    if vectors.ndim != 2 or len(vectors) != len(points):
        raise InputError(f"descriptors: expected ({len(points)}, 128 or 64), got {vectors.shape}")
    if not np.isfinite(vectors).all():
        raise InputError("descriptors: expected finite numbers, got nan or inf")
    if not (np.isfinite(points.xy).all() and (points.scale > 0).all()):
        raise InputError("keypoints: expected finite positions and sizes above 0")
    return points, vectors


def _numbers(given: ArrayLike) -> NDArray[np.float32]:
    """Return descriptors of any number type; those too large for any are inf."""
    try:
        array = np.asarray(given)
    except ValueError as error:  # of rows that differ in length
        raise InputError(f"descriptors: expected rows of one length, got {type(given).__name__}") from error
    if array.dtype.kind not in "iuf":
        raise InputError(f"descriptors: expected numbers, got an array of {array.dtype}")
    with np.errstate(over="ignore"):
        return array.astype(np.float32)


def _of_sift(
    points: Keypoints, vectors: NDArray[np.float32], variants: list[Variant], root: bool | None
) -> tuple[Detection, ...]:
    if (vectors < 0).any():
        raise InputError(f"descriptors: expected SIFT's, none below 0, got {vectors.min():g}")
    if root is None:
        both = [_of_sift(points, vectors, variants, one) for one in (False, True)]
        return max(both, key=lambda found: sum(SIFT_LIMIT - float(one.signature_distance) for one in found))
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    units = vectors / np.maximum(lengths, 1e-9)
    references = [_references(variant, root) for variant in variants]
    distances = np.array([[np.linalg.norm(units - one, axis=1) for one in each] for each in references])
    nearest = distances.min(axis=1).argmin(axis=0)
    worth, view = -distances.min(axis=(0, 1)), distances.argmin(axis=1)
    rows = np.flatnonzero((worth > -SIFT_LIMIT) & (lengths[:, 0] > 0))
    inner = np.array(
        [np.linalg.norm((units[k] - references[nearest[k]][view[nearest[k], k]])[SIGNATURE]) for k in rows]
    )
    sides = points.scale / 2 * SIDE_OF_SIGMA / np.where([variants[k].limit == "range" for k in nearest], np.sqrt(2), 1)
    signature = dict(zip(rows.tolist(), inner.tolist(), strict=True))
    kept = rows[suppress_non_maxima(points.xy[rows], sides[rows], worth[rows])]
    return tuple(
        Detection(
            id=number,
            xy=points.xy[row].astype(np.float64),
            size=float(sides[row]),
            polarity=variants[nearest[row]].polarity,
            limit=variants[nearest[row]].limit,
            made_for="sift",
            response=float(points.response[row]),
            signature_distance=signature[int(row)],
            rank=int(row) + 1,
        )
        for number, row in enumerate(kept)
    )


def _references(variant: Variant, is_root: bool) -> NDArray[np.float64]:
    vectors = sift_views(variant)
    return np.asarray(np.sqrt(vectors / vectors.sum(axis=1, keepdims=True))) if is_root else vectors


def _of_surf(points: Keypoints, vectors: NDArray[np.float32], wanted: tuple[Polarity, ...]) -> tuple[Detection, ...]:
    if not (points.response > 0).any():
        raise InputError("keypoints: expected the responses of SURF's key points, by which markers stand out, got none")
    order = np.argsort(-points.response, kind="stable")
    vectors = vectors[order] / np.maximum(np.linalg.norm(vectors[order], axis=1, keepdims=True), 1e-9)
    ranked = points[order].with_columns(descriptors=vectors)
    if not ranked.laplacian.any():
        told = np.array([1 if one == "dark" else -1 for one in polarity_by_signature(vectors)])
        ranked = ranked.with_columns(laplacian=told)
    chosen = wanted[0] if len(wanted) == 1 else None
    distances = signature_distances(vectors, chosen)
    rows = select_markers(ranked, distances, chosen)
    found = unrefined_detections(ranked, distances, chosen, rows)
    return tuple(_with_row(one, int(order[one.rank - 1])) for one in found)


def _with_row(detection: Detection, row: int) -> Detection:
    return replace(detection, rank=row + 1)
