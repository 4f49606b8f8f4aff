"""What a still view of the floor says of each marker: its features' ranks, and how far away it looks."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from peaksim.camera.frame import MarkerTruth

from peakmark.experiments.floor.view import FloorView
from peakmark.identification.api import refine_detections
from peakmark.identification.detection import SIDE_OF_SCALE, Detection
from peakmark.keypoints.image import as_gray
from peakmark.localise.distance import distances_at_height, distances_of_shapes, solid_angles
from peakmark.localise.locate import FloorMap
from peakmark.report.page import Table

DISTANCE_NOTE = (
    "Ranks: of all features at the marker's centre that are stronger than all clutter; where there are two, another "
    "octave has found the marker again, mostly with another orientation. Distances from the scale are the paper's "
    "first assumption, with the camera's height known, as a robot's is; refined ones come from the aligned shape alone."
)


def marker_table(view: FloorView, floor_map: FloorMap | None) -> Table:
    """Return one row a marker: truth beside what was found; without a map of level markers no estimated distances."""
    head = ("marker", "side (px)", "tilt (°)", "visible", "ranks", "orientations (°)", "response", "signature")
    distances = ("distance (m)", "from scale (m)", "refined (m)", "error (px)")
    estimates = estimated_distances(view, floor_map)
    return Table((*head, *distances), [_marker_row(view, t, estimates) for t in view.frame.truth])


def _marker_row(view: FloorView, truth: MarkerTruth, estimates: dict[str, tuple[float, float | None]]) -> list[Any]:
    rows = [rank - 1 for rank in view.ranks().get(truth.name, ())]
    known = [truth.name, truth.side_px, truth.tilt_deg, truth.visible_fraction]
    named = [", ".join(str(row + 1) for row in rows) or None]
    angles = [", ".join(f"{view.found.features.angle[row]:.0f}" for row in rows) or None]
    if truth.name not in view.score.matches:
        return [*known, *named, *angles, None, None, truth.distance_m, None, None, None]
    found = view.found.detections[view.score.matches[truth.name]]
    error_px = float(np.linalg.norm(found.xy - truth.center_xy))
    distances = [truth.distance_m, *estimates.get(truth.name, (None, None))]
    return [*known, *named, *angles, found.response, found.signature_distance, *distances, error_px]


def estimated_distances(view: FloorView, floor_map: FloorMap | None) -> dict[str, tuple[float, float | None]]:
    """Return of each found marker its distance from the feature's scale, and from its refined shape, metres.

    The first takes the camera's height above the floor as known; the second is None where the pattern could not be
    aligned. Without a map of level markers there are none.
    """
    names = list(view.score.matches)
    if floor_map is None or not names:
        return {}
    found = tuple(view.found.detections[view.score.matches[name]] for name in names)
    rows = np.array([detection.rank - 1 for detection in found], dtype=np.intp)
    features, camera = view.found.features[rows], view.frame.camera
    height_m = float(view.frame.world_from_camera[2, 3] - floor_map.centers_m[0, 2])
    angles = solid_angles(camera, features.xy, SIDE_OF_SCALE * features.scale.astype(np.float64))
    by_scale = distances_at_height(angles, floor_map.side_m, height_m)
    by_shape = _distances_of_shapes(view, found, floor_map.side_m)
    return {name: (float(by_scale[k]), by_shape[k]) for k, name in enumerate(names)}


def _distances_of_shapes(view: FloorView, found: tuple[Detection, ...], side_m: float) -> list[float | None]:
    refined = found if found[0].affinity is not None else refine_detections(as_gray(view.frame.image), found)
    unknown: NDArray[np.float64] = np.full((2, 2), np.nan)
    affinity = np.array([unknown if d.affinity is None else d.affinity for d in refined])
    has_shape = np.isfinite(affinity).all(axis=(1, 2))
    by_shape, _ = distances_of_shapes(
        view.frame.camera, np.array([d.xy for d in refined]), np.nan_to_num(affinity), side_m
    )
    return [float(distance) if known else None for distance, known in zip(by_shape, has_shape, strict=True)]
