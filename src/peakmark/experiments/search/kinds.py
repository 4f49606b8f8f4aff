"""The kinds of markers side by side: the same frames with each of them, found by the detector that it is made for.

Photographs, cameras and noise that nothing was trained on; see `places`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise, product
from time import process_time
from typing import Any, get_args

import cv2
import numpy as np
from numpy.typing import NDArray
from peaksim.camera.frame import MarkerTruth

from peakmark.arrays.decode import decode_arrays
from peakmark.errors import InputError
from peakmark.experiments.journal import Journal
from peakmark.experiments.option import check_choice
from peakmark.experiments.run import OnStep, run_items
from peakmark.experiments.search.places import Place, View, view_of
from peakmark.identification.alignment import noise_sigma_of
from peakmark.identification.detection import Detection
from peakmark.identification.families import SOURCES
from peakmark.identification.general import detect_markers
from peakmark.markers.optimum import Limit
from peakmark.markers.patterns import Variant
from peakmark.parallel import threads
from peakmark.score.arrays import printed_arrays, score_arrays
from peakmark.score.statistics import wilson

KINDS: tuple[tuple[str, Limit], ...] = (
    ("surf", "energy"),
    ("sift", "energy"),
    ("sift", "range"),
    ("surf-disc", "range"),
)
"""Detectors, and limits of the markers that they look for."""

LEAST_PX, STEEPEST_DEG, LEAST_VISIBLE = 20.0, 60.0, 0.99
"""Side from which, tilt up to which, and share in sight from which a marker is to be found."""

NEAR = 0.1
"""Distance from a marker, sides, within which a detection is one of it."""

GROUPS: dict[str, tuple[float, ...]] = {
    "tilt_deg": (0, 30, 45, 60.1),
    "side_px": (20, 30, 45, 70, 1000),
    "noise": (0, 1, 2, 4, 255),
    "blur_px": (0, 0.3, 0.5, 5),
}
"""Edges of the groups of markers: by tilt, by side, by the image's noise, grey levels, and by the blur of the lens."""


@dataclass(frozen=True)
class KindsConfig:
    """How much."""

    frames: int = 40
    """Frames of each place."""
    seed: int = 0
    """Of frames."""
    places: tuple[Place, ...] = ("sheets",)
    """Which."""

    def __post_init__(self) -> None:
        if not 1 <= self.frames <= 100_000 or self.seed < 0:
            raise InputError(f"expected --frames 1…100000 and --seed 0 or more, got {self.frames} and {self.seed}")
        if not self.places:
            raise InputError(f"--place: expected some of {', '.join(get_args(Place))}, got none")
        for place in self.places:
            check_choice("place", place, get_args(Place))


def compare_kinds(
    config: KindsConfig, journal: Journal, workers: int = 1, on_step: OnStep = lambda done, of: None
) -> list[dict[str, Any]]:
    """Return one row a place and kind: rates with 95 % intervals, errors of centres, CPU over OpenCV's SIFT."""
    names = [_name(*item) for item in _items(config)]
    records = run_items(journal, names, partial(_record, config), workers, on_step)
    chunks = [records[k : k + config.frames] for k in range(0, len(records), config.frames)]
    shown = product(dict.fromkeys(config.places), KINDS)
    return [_row(place, kind, chunk) for (place, kind), chunk in zip(shown, chunks, strict=True)]


def _items(config: KindsConfig) -> list[tuple[Place, tuple[str, Limit], int]]:
    return list(product(dict.fromkeys(config.places), KINDS, range(config.frames)))


def faults(config: KindsConfig, journal: Journal) -> list[dict[str, Any]]:
    """Return what was missed, made up or not read in a finished run, by frame; `frame_of` makes a frame again."""
    found = []
    for place, kind, number in _items(config):
        record = journal.records[_name(place, kind, number)]
        missed = [marker for marker in record.get("markers", ()) if not marker["found"]]
        if missed or record.get("false") or record.get("unread"):
            where = {"place": place, "detector": kind[0], "limit": kind[1], "number": number}
            found.append(where | {"missed": missed, "false": record["false"], "unread": record["unread"]})
    return found


def _name(place: Place, kind: tuple[str, Limit], number: int) -> str:
    return f"{place} {kind[0]} {kind[1]} {number}"


def frame_of(place: Place, kind: tuple[str, Limit], seed: int, number: int) -> tuple[View | None, tuple[Variant, ...]]:
    """Return a view with a kind of markers, and which these are."""
    made_for, limit = SOURCES[kind[0]][0], kind[1]
    dark, light = Variant("dark", limit, made_for), Variant("light", limit, made_for)
    return view_of(place, seed, number, dark, light), (dark, light)


def _record(config: KindsConfig, index: int) -> dict[str, Any]:
    """Return what one frame shows of one kind; nothing where there is no frame."""
    place, kind, number = _items(config)[index]
    view, variants = frame_of(place, kind, config.seed, number)
    if view is None:
        return {}
    with threads(1):
        start = process_time()
        found = detect_markers(view.gray, variants, kind[:1])
        spent = process_time() - start
    cv2.setNumThreads(1)
    start = process_time()
    cv2.SIFT_create(enable_precise_upscale=True).detectAndCompute(view.gray, None)  # type: ignore[attr-defined]
    clocks = {"cpu_s": spent, "opencv_s": process_time() - start}
    image = {"noise": noise_sigma_of(view.gray), "blur_px": view.blur_px}
    return {**_scored(found, view.truth, view.gray.shape), **_arrays(view, found), **clocks, **image}


def _scored(found: tuple[Detection, ...], truth: tuple[MarkerTruth, ...], shape: tuple[int, ...]) -> dict[str, Any]:
    """Return a row for each marker that is to be found, and the detections at none."""
    rows: list[dict[str, Any]] = []
    used: set[int] = set()
    for marker in truth:
        if not np.isfinite(marker.side_px) or marker.visible_fraction == 0:
            continue
        near = [d for d in found if np.linalg.norm(d.xy - marker.center_xy) < NEAR * marker.side_px]
        used |= {d.id for d in near}
        if _is_wanted(marker, shape):
            row = {"name": marker.name, "side_px": marker.side_px, "tilt_deg": marker.tilt_deg, "found": bool(near)}
            rows.append(row | (_compared(near, marker) if near else {}))
    false = [[*map(float, d.xy), d.size, d.probability, d.kind] for d in found if d.id not in used]
    return {"markers": rows, "false": false, "detections": len(found)}


def _is_wanted(marker: MarkerTruth, shape: tuple[int, ...]) -> bool:
    inside = (marker.corners_xy > -0.5) & (marker.corners_xy < np.array(shape[::-1]) - 0.5)
    is_plain = marker.visible_fraction > LEAST_VISIBLE and marker.tilt_deg <= STEEPEST_DEG
    return bool(inside.all()) and is_plain and marker.side_px >= LEAST_PX


def _compared(near: list[Detection], marker: MarkerTruth) -> dict[str, Any]:
    """Return how the nearest detection compares with the truth."""
    best = min(near, key=lambda d: float(np.linalg.norm(d.xy - marker.center_xy)))
    error: NDArray[np.float64] = best.xy - marker.center_xy
    square = None if best.covariance is None else float(error @ np.linalg.solve(best.covariance, error))
    wrong = best.polarity != marker.kind.rsplit("-", 1)[1]
    return {"wrong": wrong, "error_px": float(np.linalg.norm(error)), "square": square}


def _arrays(view: View, found: tuple[Detection, ...]) -> dict[str, Any]:
    """Return the names of the arrays that are to be read and were not, how many were, and codes that are not there."""
    if view.frame is None or view.scene is None:
        return {"arrays": 0, "unread": [], "wrong_codes": 0}
    arrays, printed = decode_arrays(found, image=view.gray), printed_arrays(view.scene)
    score = score_arrays(printed, view.truth, arrays, view.frame.camera, view.frame.world_from_camera)
    return {"arrays": len(score.in_view), "unread": list(score.missed), "wrong_codes": score.wrong}


def _row(place: Place, kind: tuple[str, Limit], records: Sequence[dict[str, Any]]) -> dict[str, Any]:
    records = [record for record in records if record]
    of_image = ("noise", "blur_px")
    markers = [marker | {key: r[key] for key in of_image} for r in records for marker in r["markers"]]
    hits = [marker for marker in markers if marker["found"]]
    errors = np.array([marker["error_px"] for marker in hits])
    squares = np.array([marker["square"] for marker in hits if marker["square"] is not None])
    wrong, false = sum(marker["wrong"] for marker in hits), sum(len(record["false"]) for record in records)
    detections = sum(record["detections"] for record in records)
    arrays = sum(record["arrays"] for record in records)
    read = arrays - sum(len(record["unread"]) for record in records)
    return {
        "place": place,
        "detector": kind[0],
        "limit": kind[1],
        "frames": len(records),
        "wanted": len(markers),
        "found": len(hits),
        "recall": list(wilson(len(hits), len(markers))),
        "detections": detections,
        "false": false,
        "precision": list(wilson(detections - false, detections)),
        "wrong": wrong,
        "wrong_polarity": list(wilson(wrong, len(hits))),
        "arrays": arrays,
        "arrays_read": read,
        "arrays_recall": list(wilson(read, arrays)),
        "wrong_codes": sum(record["wrong_codes"] for record in records),
        "median_px": float(np.median(errors)) if len(errors) else None,
        "rms_px": float(np.sqrt(np.mean(errors**2 / 2))) if len(errors) else None,
        "normalised_square": float(np.median(squares)) if len(squares) else None,
        "cpu_over_opencv_sift": sum(r["cpu_s"] for r in records) / sum(r["opencv_s"] for r in records),
        "groups": {by: _groups(markers, by, edges) for by, edges in GROUPS.items()},
    }


def _groups(markers: Sequence[dict[str, Any]], by: str, edges: Sequence[float]) -> list[dict[str, Any]]:
    """Return how many are found of those in each range of a figure."""
    rows = []
    for low, high in pairwise(edges):
        own = [marker["found"] for marker in markers if marker[by] is not None and low <= marker[by] < high]
        rows.append(
            {"from": low, "to": high, "of": len(own), "found": sum(own), "interval": list(wilson(sum(own), len(own)))}
        )
    return rows
