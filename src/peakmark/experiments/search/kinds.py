"""The kinds of markers side by side: the same frames with each of them, found by the detector that it is made for.

Photographs that nothing was trained on, twelve sheets a frame in one plane, any rotation, tilts to 60°, in even light.
"""

from dataclasses import dataclass
from functools import partial
from time import process_time
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from peaksim.camera.frame import MarkerTruth

from peakmark.errors import InputError
from peakmark.experiments.cave.rooms import photographs
from peakmark.experiments.journal import Journal
from peakmark.experiments.run import OnStep, run_items
from peakmark.experiments.search.lit_images import plain_image
from peakmark.identification.detection import Detection
from peakmark.identification.families import SOURCES
from peakmark.identification.general import detect_markers
from peakmark.markers.optimum import Limit
from peakmark.markers.patterns import Variant
from peakmark.parallel import threads
from peakmark.score.statistics import wilson

KINDS: tuple[tuple[str, Limit], ...] = (
    ("surf", "energy"),
    ("sift", "energy"),
    ("sift", "range"),
    ("surf-disc", "range"),
)
"""Detectors, and limits of the markers that they look for."""

LEAST_PX = 20.0
"""Side from which a marker is to be found."""

NEAR = 0.1
"""Distance from a marker, sides, within which a detection is one of it."""


@dataclass(frozen=True)
class KindsConfig:
    """How much."""

    frames: int = 40
    """Frames, of twelve markers each."""
    seed: int = 0
    """Of frames."""

    def __post_init__(self) -> None:
        if not 1 <= self.frames <= 100_000 or self.seed < 0:
            raise InputError(f"expected --frames 1…100000 and --seed 0 or more, got {self.frames} and {self.seed}")


def compare_kinds(
    config: KindsConfig, journal: Journal, workers: int = 1, on_step: OnStep = lambda done, of: None
) -> list[dict[str, Any]]:
    """Return one row a kind: rates with 95 % intervals, errors of centres, CPU seconds over OpenCV's SIFT."""
    names = [f"{detector} {limit} {k}" for detector, limit in KINDS for k in range(config.frames)]
    records = run_items(journal, names, partial(_record, config), workers, on_step)
    size = config.frames
    return [_row(kind, records[k * size : (k + 1) * size]) for k, kind in enumerate(KINDS)]


def _record(config: KindsConfig, index: int) -> dict[str, Any]:
    """Return what one frame shows of one kind."""
    (detector, limit), number = KINDS[index // config.frames], index % config.frames
    made_for = SOURCES[detector][0]
    kinds = (Variant("dark", limit, made_for), Variant("light", limit, made_for))
    image = plain_image(np.random.default_rng((config.seed, number)), photographs("held-out"), kinds)
    with threads(1):
        start = process_time()
        found = detect_markers(image.gray, kinds, (detector,))
        spent = process_time() - start
    cv2.setNumThreads(1)
    start = process_time()
    cv2.SIFT_create(enable_precise_upscale=True).detectAndCompute(image.gray, None)  # type: ignore[attr-defined]
    return {**_scored(found, image.truth, image.gray.shape), "cpu_s": spent, "opencv_s": process_time() - start}


def _scored(found: tuple[Detection, ...], truth: tuple[MarkerTruth, ...], shape: tuple[int, ...]) -> dict[str, Any]:
    wanted, hits, wrong, errors, squares = 0, 0, 0, [], []
    used: set[int] = set()
    for marker in truth:
        inside = (marker.corners_xy > -0.5) & (marker.corners_xy < np.array(shape[::-1]) - 0.5)
        near = [d for d in found if np.linalg.norm(d.xy - marker.center_xy) < NEAR * marker.side_px]
        used |= {d.id for d in near}
        if not (inside.all() and marker.visible_fraction > 0.99 and marker.side_px >= LEAST_PX):
            continue
        wanted += 1
        if near:
            best = min(near, key=lambda d: float(np.linalg.norm(d.xy - marker.center_xy)))
            hits, wrong = hits + 1, wrong + (best.polarity != marker.kind.rsplit("-", 1)[1])
            error: NDArray[np.float64] = best.xy - marker.center_xy
            errors.append(float(np.linalg.norm(error)))
            if best.covariance is not None:
                squares.append(float(error @ np.linalg.solve(best.covariance, error)))
    return {
        "wanted": wanted,
        "found": hits,
        "wrong": wrong,
        "false": sum(d.id not in used for d in found),
        "detections": len(found),
        "errors_px": errors,
        "squares": squares,
    }


def _row(kind: tuple[str, Limit], records: list[dict[str, Any]]) -> dict[str, Any]:
    total = {key: sum(record[key] for record in records) for key in ("wanted", "found", "wrong", "false", "detections")}
    errors = np.array([error for record in records for error in record["errors_px"]])
    squares = np.array([square for record in records for square in record["squares"]])
    real = total["detections"] - total["false"]
    return {
        "detector": kind[0],
        "limit": kind[1],
        **total,
        "recall": list(wilson(total["found"], total["wanted"])),
        "precision": list(wilson(real, total["detections"])),
        "wrong_polarity": list(wilson(total["wrong"], total["found"])),
        "median_px": float(np.median(errors)) if len(errors) else None,
        "rms_px": float(np.sqrt(np.mean(errors**2 / 2))) if len(errors) else None,
        "normalised_square": float(np.median(squares)) if len(squares) else None,
        "cpu_over_opencv_sift": sum(r["cpu_s"] for r in records) / sum(r["opencv_s"] for r in records),
    }
