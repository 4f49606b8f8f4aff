"""Trains the screen of the general search: which candidates are worth an alignment.

`screen.json` of `peakmark.identification` is what `scripts/train_screen.py` writes, from images like those of
`training`. A candidate is one to be kept if the decision that ships finds a marker by it. The limit comes from
images that each of the models did not learn from, and counts markers: one that is found by another candidate is not
lost.
"""

from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from peaksim.extras import needs_extra

from peakmark.experiments.journal import Journal
from peakmark.experiments.run import OnStep, run_items
from peakmark.experiments.search.training import (
    CLUTTER,
    FOLDS,
    MARKER,
    SearchTrainingConfig,
    label_of,
    marker_of,
    training_image,
)
from peakmark.identification.general import align_image
from peakmark.identification.marker_model import shipped_model
from peakmark.identification.screening import SCREEN_COLUMNS
from peakmark.identification.trees import Trees, from_boosting
from peakmark.report.results import result_folder, write_json

LOST = 0.003
"""Share of the markers found without a screen that it may lose."""


@dataclass(frozen=True)
class Screened:
    """Candidates that could be aligned, and what came of them."""

    looks: NDArray[np.float64]
    """(n, c) see `SCREEN_COLUMNS`."""
    found: NDArray[np.bool_]
    """(n,) whether a marker is found by it."""
    is_clutter: NDArray[np.bool_]
    """(n,) whether it is nothing of a marker."""
    images: NDArray[np.int64]
    """(n,) the image of each."""
    markers: NDArray[np.int64]
    """(n,) number of the marker in its image, −1 of none."""


def collect_looks(
    config: SearchTrainingConfig, journal: Journal, workers: int = 1, on_step: OnStep = lambda done, of: None
) -> Screened:
    """Return what the search aligns in the images without a screen."""
    records = run_items(journal, config.names, partial(_record, config), workers, on_step)
    rows = [(*row, image) for image, record in enumerate(records) for row in record]
    looks = np.array([row[0] for row in rows], dtype=np.float64).reshape(-1, len(SCREEN_COLUMNS))
    label, likely, marker, image = (np.array([row[k] for row in rows]) for k in range(1, 5))
    is_found = (label == MARKER) & (likely > shipped_model()[1])
    return Screened(looks, is_found, label == CLUTTER, image.astype(np.int64), marker.astype(np.int64))


def _record(config: SearchTrainingConfig, index: int) -> list[tuple[list[float], int, float, int]]:
    """Return look, label, probability and marker of each alignment of an image."""
    image = training_image(config, index)
    found = align_image(image.gray, config.variants)
    places, likely = found.aligned.theta[:, :2], shipped_model()[0].probabilities(found.evidence)
    return [
        (
            [float(f"{value:.6g}") for value in look],
            label_of(xy, float(side), variant, image.truth, image.gray.shape),
            float(f"{probability:.6g}"),
            marker_of(xy, image.truth),
        )
        for look, xy, side, variant, probability in zip(
            found.looks, places, found.sides_px, found.variants, likely, strict=True
        )
    ]


def train(screened: Screened, config: SearchTrainingConfig) -> dict[str, Any]:
    """Return what the screen's file holds: boosted trees and the limit."""
    sums = unseen_sums(screened)
    least = choose_limit(sums, screened)
    is_clutter = screened.is_clutter
    known = screened.found | is_clutter
    return {
        "origin": f"scripts/train_screen.py --images {config.images} --empty {config.empty} --seed {config.seed}",
        "markers": len(best_sums(sums, screened)),
        "clutter": int(is_clutter.sum()),
        "lost": LOST,
        "stopped": float((sums[is_clutter] < least).mean()),
        "config": asdict(config),
        "columns": list(SCREEN_COLUMNS),
        "least": least,
        "trees": fit_trees(screened.looks[known], screened.found[known]).to_plain(),
    }


@needs_extra
def fit_trees(looks: NDArray[np.float64], is_found: NDArray[np.bool_]) -> Trees:
    """Return boosted trees that tell by their looks which candidates a marker is found by."""
    from sklearn.ensemble import HistGradientBoostingClassifier
    from threadpoolctl import threadpool_limits

    learner = HistGradientBoostingClassifier(
        max_iter=200, learning_rate=0.07, max_leaf_nodes=8, l2_regularization=10.0, min_samples_leaf=20, random_state=0
    )
    with threadpool_limits(1):
        return from_boosting(learner.fit(looks, is_found))


def unseen_sums(screened: Screened) -> NDArray[np.float64]:
    """Return (n,) sums of trees that learned from other images than the candidate's own."""
    sums, known = np.zeros(len(screened.looks)), screened.found | screened.is_clutter
    for fold in range(FOLDS):
        own = screened.images % FOLDS == fold
        others = known & ~own
        if own.any():
            sums[own] = fit_trees(screened.looks[others], screened.found[others]).sums(screened.looks[own])
    return sums


def choose_limit(sums: NDArray[np.float64], screened: Screened) -> float:
    """Return the sum from which a candidate is aligned, so that few markers are lost; −∞ without any marker."""
    best = np.sort(best_sums(sums, screened))
    return float(best[int(LOST * len(best))]) if len(best) else -np.inf


def best_sums(sums: NDArray[np.float64], screened: Screened) -> list[float]:
    """Return of each marker that is found the highest sum of the candidates that find it."""
    best: dict[tuple[int, int], float] = {}
    for row in np.flatnonzero(screened.found):
        key = (int(screened.images[row]), int(screened.markers[row]))
        best[key] = max(float(sums[row]), best.get(key, -np.inf))
    return list(best.values())


def write_screen(out: Path, screen: dict[str, Any]) -> None:
    """Write screen.json and result.json."""
    kept = ("origin", "markers", "clutter", "lost", "stopped", "least")
    with result_folder(out) as folder:
        write_json(folder / "screen.json", screen)
        write_json(folder / "result.json", {key: screen[key] for key in kept})


def result_rows(screen: dict[str, Any]) -> list[tuple[str, Any]]:
    """Return the headline figures for the terminal."""
    return [
        ("markers that are found", screen["markers"]),
        ("of them lost, at most", screen["lost"]),
        ("alignments of everything else", screen["clutter"]),
        ("of them stopped before", screen["stopped"]),
    ]
