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
from peakmark.identification.screening import SCREEN_COLUMNS, gate_columns
from peakmark.identification.stages import STAGE_COLUMNS, STAGES
from peakmark.identification.trees import Trees, from_boosting
from peakmark.report.results import result_folder, write_json

LOST = (0.002, 0.001, 0.001, 0.001)
"""Shares of the markers found without a screen that each gate may lose."""


@dataclass(frozen=True)
class Screened:
    """Candidates that could be aligned, and what came of them."""

    looks: NDArray[np.float64]
    """(n, c) see `SCREEN_COLUMNS`."""
    said: NDArray[np.float64]
    """(n, stages, c) see `stages`; nan of the parts where there was no second look."""
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
    said = np.array([row[1] for row in rows], dtype=np.float64).reshape(-1, len(STAGES), len(STAGE_COLUMNS))
    label, likely, marker, image = (np.array([row[k] for row in rows]) for k in range(2, 6))
    is_found = (label == MARKER) & (likely > shipped_model()[1])
    return Screened(looks, said, is_found, label == CLUTTER, image.astype(np.int64), marker.astype(np.int64))


def _record(config: SearchTrainingConfig, index: int) -> list[tuple[list[float], list[float], int, float, int]]:
    """Return look, what the stages said, label, probability and marker of each alignment of an image."""
    image = training_image(config, index)
    found = align_image(image.gray, config.variants)
    places, likely = found.aligned.theta[:, :2], shipped_model()[0].probabilities(found.evidence)
    return [
        (
            _short(look),
            _short(said.ravel()),
            label_of(xy, float(side), variant, image.truth, image.gray.shape),
            float(f"{probability:.6g}"),
            marker_of(xy, image.truth),
        )
        for look, said, xy, side, variant, probability in zip(
            found.looks, found.aligned.said, places, found.sides_px, found.variants, likely, strict=True
        )
    ]


def _short(values: NDArray[np.float64]) -> list[float]:
    return [float(f"{value:.6g}") for value in values]


def train(screened: Screened, config: SearchTrainingConfig) -> dict[str, Any]:
    """Return what the screen's file holds: boosted trees and limits, of one gate after another."""
    known, passing = screened.found | screened.is_clutter, np.ones(len(screened.found), np.bool_)
    columns, gates, odds = screened.looks, [], np.zeros(len(screened.found))
    for number, lost in enumerate(LOST):
        if number > 0:
            columns = gate_columns(odds, screened.said[:, :number])
        asked = passing & np.isfinite(columns).all(axis=1)
        sums = unseen_sums(columns, asked, screened)
        least = choose_limit(np.where(asked, sums, np.inf), passing, screened, lost)
        stopped = asked & (sums < least)
        gates.append(
            {
                "lost": lost,
                "clutter": int((asked & screened.is_clutter).sum()),
                "stopped": float(
                    stopped[asked & screened.is_clutter].sum() / max((asked & screened.is_clutter).sum(), 1)
                ),
                "least": least,
                "trees": fit_trees(columns[asked & known], screened.found[asked & known]).to_plain(),
            }
        )
        odds, passing = sums if number == 0 else odds, passing & ~stopped
    return {
        "origin": f"scripts/train_screen.py --images {config.images} --empty {config.empty} --seed {config.seed}",
        "markers": len(best_sums(np.zeros(len(known)), screened.found, screened)),
        "clutter": int(screened.is_clutter.sum()),
        "stopped": float(1 - passing[screened.is_clutter].mean()),
        "config": asdict(config),
        "columns": list(SCREEN_COLUMNS),
        "stage_columns": list(STAGE_COLUMNS),
        "gates": gates,
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


def unseen_sums(columns: NDArray[np.float64], asked: NDArray[np.bool_], screened: Screened) -> NDArray[np.float64]:
    """Return (n,) sums of trees that learned from other images than the candidate's own; 0 of those not asked."""
    sums, known = np.zeros(len(columns)), asked & (screened.found | screened.is_clutter)
    for fold in range(FOLDS):
        is_own = screened.images % FOLDS == fold
        own, others = asked & is_own, known & ~is_own
        if own.any():
            sums[own] = fit_trees(columns[others], screened.found[others]).sums(columns[own])
    return sums


def choose_limit(sums: NDArray[np.float64], passing: NDArray[np.bool_], screened: Screened, lost: float) -> float:
    """Return the sum from which a candidate passes, so that few markers are lost that came so far; −∞ without any."""
    best = np.sort(best_sums(sums, passing & screened.found, screened))
    return float(best[int(lost * len(best))]) if len(best) else -np.inf


def best_sums(sums: NDArray[np.float64], rows: NDArray[np.bool_], screened: Screened) -> list[float]:
    """Return of each marker the highest sum of the chosen candidates that find it."""
    best: dict[tuple[int, int], float] = {}
    for row in np.flatnonzero(rows):
        key = (int(screened.images[row]), int(screened.markers[row]))
        best[key] = max(float(sums[row]), best.get(key, -np.inf))
    return list(best.values())


def write_screen(out: Path, screen: dict[str, Any]) -> None:
    """Write screen.json and result.json."""
    kept = ("origin", "markers", "clutter", "stopped")
    gates = [{key: gate[key] for key in gate if key != "trees"} for gate in screen["gates"]]
    with result_folder(out) as folder:
        write_json(folder / "screen.json", screen)
        write_json(folder / "result.json", {**{key: screen[key] for key in kept}, "gates": gates})


def result_rows(screen: dict[str, Any]) -> list[tuple[str, Any]]:
    """Return the headline figures for the terminal."""
    return [
        ("markers that are found", screen["markers"]),
        ("alignments of everything else", screen["clutter"]),
        ("of them stopped before the end", screen["stopped"]),
        *((f"… at gate {k}, of what comes so far", gate["stopped"]) for k, gate in enumerate(screen["gates"])),
    ]
