"""Trains the decision of the general search: alignments of markers against those of everything else.

`general.json` of `peakmark.identification` is what `scripts/train_search.py` writes: from random images with markers
and others without, both of photographs of the training split of `cave.rooms`. Trees would recite what they learned; so
the calibration and the threshold come from images that each of `FOLDS` models did not learn from.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import partial
from itertools import pairwise, product
from pathlib import Path
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray
from peaksim.camera.frame import MarkerTruth
from peaksim.extras import needs_extra

from peakmark.errors import InputError, check_choice
from peakmark.experiments.cave.rooms import photographs
from peakmark.experiments.journal import Journal
from peakmark.experiments.run import OnStep, run_items
from peakmark.experiments.search.lit_images import LitImage, empty_image, random_image
from peakmark.identification.families import FAMILIES
from peakmark.identification.general import Alignments, align_image
from peakmark.identification.trees import Trees, from_boosting
from peakmark.markers.optimum import Limit
from peakmark.markers.patterns import Made, Polarity, Variant
from peakmark.report import plots
from peakmark.report.results import result_folder, write_json
from peakmark.score.statistics import wilson

MARKER, CLUTTER, UNDECIDED = 1, 0, -1
"""Labels of an alignment; undecided are those on a marker but not at its place, and on markers cut or hardly seen."""

FOLDS = 5

FALSE_AN_IMAGE = 1 / 25
"""Share of the images without markers in which the threshold allows a false detection. They are hostile: a third are
drawn, full of blobs and tiles, and half have a random exposure; docs/figures/search.md
has other photographs."""

BINS = (0.0, 0.01, 0.03, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.97, 0.99, 1.001)
"""Of the reliability diagram."""

LEAST_VISIBLE = 0.5
"""Share of a marker from which it is one to be found."""


@dataclass(frozen=True)
class SearchTrainingConfig:
    """What to train on."""

    images: int = 480
    """Random images with markers."""
    empty: int = 320
    """Images without any."""
    seed: int = 0
    """Of the images."""
    made_for: Made = "surf"
    """The detector that the markers are made for."""

    def __post_init__(self) -> None:
        for name, least in (("images", 1), ("empty", 1), ("seed", 0)):
            if not least <= getattr(self, name) <= 1_000_000:
                raise InputError(f"--{name}: expected {least}…1000000, got {getattr(self, name)}")
        check_choice(self.made_for, get_args(Made), "--detector")

    @property
    def names(self) -> list[str]:
        """Of the images: those with markers come first."""
        return [f"lit {k}" for k in range(self.images)] + [f"empty {k}" for k in range(self.empty)]

    @property
    def columns(self) -> tuple[str, ...]:
        """Of the evidence."""
        return FAMILIES[self.made_for].columns

    @property
    def variants(self) -> tuple[Variant, ...]:
        """The markers that are aligned: for SURF, the paper's."""
        limits: tuple[Limit, ...] = ("energy",) if self.made_for == "surf" else get_args(Limit)
        return tuple(Variant(*one, self.made_for) for one in product(get_args(Polarity), limits))


@dataclass(frozen=True)
class Evidence:
    """Alignments and what they truly are."""

    columns: NDArray[np.float64]
    """(n, c) see `alignment.COLUMNS`."""
    labels: NDArray[np.int64]
    """(n,) `MARKER`, `CLUTTER` or `UNDECIDED`."""
    images: NDArray[np.int64]
    """(n,) the image of each: those with markers first, then the empty ones."""


def collect_evidence(
    config: SearchTrainingConfig, journal: Journal, workers: int = 1, on_step: OnStep = lambda done, of: None
) -> Evidence:
    """Return what the search aligns in the images, with labels."""
    records = run_items(journal, config.names, partial(_record, config), workers, on_step)
    rows = [(row, image) for image, record in enumerate(records) for row in record]
    evidence = np.array([row[0] for row, _ in rows], dtype=np.float64).reshape(-1, len(config.columns))
    labels, images = np.array([row[1] for row, _ in rows], dtype=np.int64), np.array([image for _, image in rows])
    return Evidence(evidence, labels, images.astype(np.int64))


def training_image(config: SearchTrainingConfig, index: int) -> LitImage:
    """Return one of the images: those with markers come first."""
    is_empty = index >= config.images
    number = index - config.images if is_empty else index
    rng = np.random.default_rng((config.seed, int(is_empty), number))
    photos = photographs("training")
    return empty_image(rng, photos) if is_empty else random_image(rng, photos, config.made_for)


def _record(config: SearchTrainingConfig, index: int) -> list[tuple[list[float], int]]:
    image = training_image(config, index)
    return labelled(align_image(image.gray, config.variants), image.truth, image.gray.shape)


def labelled(found: Alignments, truth: Sequence[MarkerTruth], shape: tuple[int, ...]) -> list[tuple[list[float], int]]:
    """Return evidence and label of each alignment of an image of a shape."""
    sides, places = found.sides_px, found.aligned.theta[:, :2]
    return [
        ([float(f"{value:.6g}") for value in evidence], label_of(xy, float(side), variant, truth, shape))
        for xy, side, variant, evidence in zip(places, sides, found.variants, found.evidence, strict=True)
    ]


def label_of(
    xy: NDArray[np.float64], side_px: float, variant: Variant, truth: Sequence[MarkerTruth], shape: tuple[int, ...]
) -> int:
    """Return what an alignment truly is."""
    label = CLUTTER
    for marker in truth:
        if not np.isfinite(marker.side_px) or marker.visible_fraction == 0:
            continue
        gap = float(np.linalg.norm(xy - marker.center_xy))
        is_like = 0.7 < side_px / marker.side_px < 1.4 and marker.kind == variant.kind
        if gap < max(0.12 * marker.side_px, 1.5) and is_like:
            return MARKER if _is_wanted(marker, shape) else UNDECIDED
        if gap < 0.75 * marker.side_px:
            label = UNDECIDED
    return label


def marker_of(xy: NDArray[np.float64], truth: Sequence[MarkerTruth]) -> int:
    """Return the number of the marker nearest to a place, in sides; −1 without any that is seen."""
    seen = [k for k, marker in enumerate(truth) if np.isfinite(marker.side_px) and marker.visible_fraction > 0]
    return min(seen, key=lambda k: np.linalg.norm(xy - truth[k].center_xy) / truth[k].side_px, default=-1)


def _is_wanted(marker: MarkerTruth, shape: tuple[int, ...]) -> bool:
    inside = (marker.corners_xy > -0.5) & (marker.corners_xy < np.array(shape[::-1]) - 0.5)
    return bool(inside.all()) and marker.visible_fraction >= LEAST_VISIBLE


def train(evidence: Evidence, config: SearchTrainingConfig) -> dict[str, Any]:
    """Return what the model's file holds: boosted trees, their calibration, and the threshold."""
    kept = evidence.labels != UNDECIDED
    values, is_marker, images = evidence.columns[kept], evidence.labels[kept] == MARKER, evidence.images[kept]
    trees = fit_trees(values, is_marker)
    sums = unseen_sums(values, is_marker, images)
    slope, offset = calibrate(sums, is_marker)
    likely = 1 / (1 + np.exp(-np.clip(slope * sums + offset, -50, 50)))
    return {
        "origin": f"scripts/train_search.py {'' if config.made_for == 'surf' else '--detector sift '}"
        f"--images {config.images} --empty {config.empty} --seed {config.seed}",
        "markers": int(is_marker.sum()),
        "clutter": int((~is_marker).sum()),
        "config": asdict(config),
        "columns": list(config.columns),
        **{
            "threshold" if limit == "energy" else f"{limit}_threshold": choose_threshold(
                likely[rows], is_marker[rows], images[rows], config
            )
            for limit, rows in _rows_by_limit(values, config).items()
        },
        "reliability": reliability_of(likely, is_marker),
        "slope": slope,
        "offset": offset,
        "trees": trees.to_plain(),
    }


@needs_extra
def _rows_by_limit(values: NDArray[np.float64], config: SearchTrainingConfig) -> dict[Limit, NDArray[np.bool_]]:
    """Return which alignments are with a pattern of each limit: a search for one sees no clutter of the other."""
    if config.made_for == "surf":
        return {"energy": np.ones(len(values), np.bool_)}
    is_disc = values[:, config.columns.index("is_disc")] > 0
    return {"energy": ~is_disc, "range": is_disc}


@needs_extra
def fit_trees(values: NDArray[np.float64], is_marker: NDArray[np.bool_]) -> Trees:
    """Return boosted trees that tell markers by their columns."""
    from sklearn.ensemble import HistGradientBoostingClassifier
    from threadpoolctl import threadpool_limits

    learner = HistGradientBoostingClassifier(
        max_iter=300, learning_rate=0.05, max_leaf_nodes=16, l2_regularization=10.0, min_samples_leaf=20, random_state=0
    )
    with threadpool_limits(1):  # so little is slower with more, on a machine with other work
        return from_boosting(learner.fit(values, is_marker))


def unseen_sums(
    values: NDArray[np.float64], is_marker: NDArray[np.bool_], images: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Return (n,) sums of trees that learned from other images than the alignment's own."""
    sums = np.zeros(len(values))
    for fold in range(FOLDS):
        others, own = images % FOLDS != fold, images % FOLDS == fold
        if own.any():
            sums[own] = fit_trees(values[others], is_marker[others]).sums(values[own])
    return sums


@needs_extra
def calibrate(sums: NDArray[np.float64], is_marker: NDArray[np.bool_]) -> tuple[float, float]:
    """Return slope and offset from sums to log odds (Platt 1999)."""
    from sklearn.linear_model import LogisticRegression

    fitted = LogisticRegression(C=1e6).fit(sums[:, None], is_marker)
    return float(fitted.coef_[0, 0]), float(fitted.intercept_[0])


def reliability_of(likely: NDArray[np.float64], is_marker: NDArray[np.bool_]) -> list[dict[str, Any]]:
    """Return how often alignments of a probability are markers: a row of each of `BINS` that holds any."""
    rows = []
    for low, high in pairwise(BINS):
        inside = (likely >= low) & (likely < high)
        n, markers = int(inside.sum()), int(is_marker[inside].sum())
        if n:
            mean = float(likely[inside].mean())
            rows.append({"mean": mean, "markers": markers, "of": n, "interval": list(wilson(markers, n))})
    return rows


def choose_threshold(
    likely: NDArray[np.float64], is_marker: NDArray[np.bool_], images: NDArray[np.int64], config: SearchTrainingConfig
) -> float:
    """Return the probability that clutter exceeds in `FALSE_AN_IMAGE` of the images without markers."""
    largest = np.zeros(config.images + config.empty)
    np.maximum.at(largest, images[~is_marker], likely[~is_marker])
    return float(np.sort(largest[config.images :])[::-1][int(FALSE_AN_IMAGE * config.empty)])


def write_model(out: Path, model: dict[str, Any]) -> None:
    """Write general.json or sift.json, result.json and reliability.png."""
    kept = ("origin", "markers", "clutter", "threshold", "reliability")
    with result_folder(out) as folder:
        write_json(folder / FAMILIES[model["config"]["made_for"]].model, model)
        write_json(folder / "result.json", {key: model[key] for key in kept})
        figure, ax = plots.new_figure(5.5, 5.0)
        rows = model["reliability"]
        bounds = np.array([row["interval"] for row in rows])
        rates = np.array([row["markers"] / row["of"] for row in rows])
        plots.reliability(ax, np.array([row["mean"] for row in rows]), rates, bounds, model["threshold"])
        plots.save(figure, folder / "reliability.png")


def result_rows(model: dict[str, Any]) -> list[tuple[str, Any]]:
    """Return the headline figures for the terminal."""
    figures = [("alignments of markers", model["markers"]), ("of everything else", model["clutter"])]
    return [*figures, ("probability from which an alignment is a marker", model["threshold"])]
