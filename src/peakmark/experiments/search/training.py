"""Trains the decision of the general search: alignments of markers against those of everything else.

`general.json` of `peakmark.identification` is what `scripts/train_search.py` writes: from images of random light with
markers, and photographs without any, both of the training split of `cave.rooms`.
"""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from peaksim.camera.frame import MarkerTruth

from peakmark.errors import InputError
from peakmark.experiments.cave.rooms import photographs
from peakmark.experiments.journal import Journal
from peakmark.experiments.run import OnStep, run_items
from peakmark.experiments.search.lit_images import random_image
from peakmark.identification.alignment import COLUMNS
from peakmark.identification.general import Alignments, align_image
from peakmark.report.results import result_folder, write_json

MARKER, CLUTTER, UNDECIDED = 1, 0, -1
"""Labels of an alignment; undecided are those on a marker but not at its place, and on markers cut or hardly seen."""

WIDTHS_PX = (320, 512, 800)
"""At which each photograph is searched, sharp and softened."""


@dataclass(frozen=True)
class SearchTrainingConfig:
    """What to train on."""

    images: int = 240
    """Random images with markers."""
    seed: int = 0
    """Of the images."""

    def __post_init__(self) -> None:
        if not 1 <= self.images <= 100_000 or self.seed < 0:
            raise InputError(f"expected --images 1…100000 and --seed 0 or more, got {self.images} and {self.seed}")


@dataclass(frozen=True)
class Evidence:
    """Alignments and what they truly are."""

    columns: NDArray[np.float64]
    """(n, c) see `alignment.COLUMNS`."""
    labels: NDArray[np.int64]
    """(n,) `MARKER`, `CLUTTER` or `UNDECIDED`."""


def collect_evidence(
    config: SearchTrainingConfig, journal: Journal, workers: int = 1, on_step: OnStep = lambda done, of: None
) -> Evidence:
    """Return what the search aligns in the images, with labels."""
    empty = list(_empty_images())
    names = [f"lit {k}" for k in range(config.images)] + [f"empty {name}" for name, _ in empty]
    records = run_items(journal, names, partial(_record, config), workers, on_step)
    rows = [row for record in records for row in record]
    evidence = np.array([row[0] for row in rows], dtype=np.float64).reshape(-1, len(COLUMNS))
    return Evidence(evidence, np.array([row[1] for row in rows], dtype=np.int64))


def _record(config: SearchTrainingConfig, index: int) -> list[tuple[list[float], int]]:
    if index < config.images:
        rng = np.random.default_rng((config.seed, index))
        image = random_image(rng, photographs("training"))
        return labelled(align_image(image.gray), image.truth)
    _, gray = list(_empty_images())[index - config.images]
    return labelled(align_image(gray), ())


def _empty_images() -> Iterator[tuple[str, NDArray[np.uint8]]]:
    """Yield the training photographs by width, sharp and softened."""
    for name, photo in photographs("training").items():
        for width in WIDTHS_PX:
            size = (width, round(photo.shape[0] * width / photo.shape[1]))
            sharp = np.asarray(cv2.resize(photo, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
            yield f"{name} {width}", sharp
            yield f"{name} {width} soft", np.asarray(cv2.GaussianBlur(sharp, (0, 0), 1.2), dtype=np.uint8)


def labelled(found: Alignments, truth: Sequence[MarkerTruth]) -> list[tuple[list[float], int]]:
    """Return evidence and label of each alignment of an image."""
    sides = found.aligned.sides_px
    return [
        (evidence.tolist(), _label(theta[:2], float(side), polarity, truth))
        for theta, side, polarity, evidence in zip(
            found.aligned.theta, sides, found.polarities, found.aligned.evidence, strict=True
        )
    ]


def _label(xy: NDArray[np.float64], side_px: float, polarity: str, truth: Sequence[MarkerTruth]) -> int:
    for marker in truth:
        if not np.isfinite(marker.side_px) or marker.visible_fraction == 0:
            continue
        gap = float(np.linalg.norm(xy - marker.center_xy))
        is_whole = marker.visible_fraction >= 0.97 and marker.side_px >= 12
        is_like = 0.7 < side_px / marker.side_px < 1.4 and marker.kind.endswith(polarity)
        if gap < max(0.1 * marker.side_px, 1.0) and is_like and is_whole:
            return MARKER
        if gap < 0.75 * marker.side_px:
            return UNDECIDED
    return CLUTTER


def train(evidence: Evidence, config: SearchTrainingConfig) -> dict[str, Any]:
    """Return what `general.json` holds: a logistic regression over standardised columns, and its threshold.

    The threshold is the probability that one alignment in a hundred of clutter exceeds: decoys on paper are many here,
    and photographs without markers stay below it.
    """
    from sklearn.linear_model import LogisticRegression

    kept = evidence.labels != UNDECIDED
    values, is_marker = evidence.columns[kept], evidence.labels[kept] == MARKER
    mean, scale = values.mean(axis=0), values.std(axis=0) + 1e-9
    fitted = LogisticRegression(C=1.0, max_iter=1000).fit((values - mean) / scale, is_marker)
    likely = fitted.predict_proba((values - mean) / scale)[:, 1]
    named = {"mean": mean, "scale": scale, "weights": fitted.coef_[0]}
    return {
        "origin": f"scripts/train_search.py --images {config.images} --seed {config.seed}",
        "markers": int(is_marker.sum()),
        "clutter": int((~is_marker).sum()),
        "config": asdict(config),
        **{key: dict(zip(COLUMNS, map(float, row), strict=True)) for key, row in named.items()},
        "offset": float(fitted.intercept_[0]),
        "threshold": float(np.quantile(likely[~is_marker], 0.99)),
    }


def write_model(out: Path, model: dict[str, Any]) -> None:
    """Write general.json and result.json."""
    with result_folder(out) as folder:
        write_json(folder / "general.json", model)
        write_json(folder / "result.json", {key: model[key] for key in ("origin", "markers", "clutter", "threshold")})


def result_rows(model: dict[str, Any]) -> list[tuple[str, Any]]:
    """Return the headline figures for the terminal."""
    figures = [("alignments of markers", model["markers"]), ("of everything else", model["clutter"])]
    figures.append(("probability from which an alignment is a marker", model["threshold"]))
    return [*figures, *((f"weight of {name}", weight) for name, weight in model["weights"].items())]
