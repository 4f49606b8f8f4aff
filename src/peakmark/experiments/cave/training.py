"""Classifiers of key points, trained on rendered rooms and evaluated on others (the paper's Section 5).

`run_training` writes classifier.json, roc.png, samples, report.html and result.json.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import astuple, dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from peaksim.extras import needs_extra

from peakmark.errors import InputError
from peakmark.experiments.cave.rooms import Split
from peakmark.experiments.cave.samples import Samples, collect_samples, join_samples, load_samples, save_samples
from peakmark.experiments.option import check_range
from peakmark.identification.classifier import COLUMNS, Classifier, Layer
from peakmark.identification.model import LAYERS
from peakmark.plain import to_plain
from peakmark.report import plots
from peakmark.report.page import Section, Table, svg_uri, write_report
from peakmark.report.results import result_folder, write_json
from peakmark.score.wanted import READABLE

Array = NDArray[np.float64]

SHIPPED = "linear"
"""Kind that `classifier.json` holds."""

CLUTTER = 10.0
"""Key points of clutter a view that the operating point lets through in the training rooms: alignment with the pattern
removes them, and what it costs sets the budget. Training markers lie far above it, which is the reserve for cameras
and noise that were never trained on."""

HIDDEN = 8
"""Units of the nonlinear classifier: twice its four inputs, chosen by hand."""


@dataclass(frozen=True)
class TrainingConfig:
    """How many rooms to render."""

    training_rooms: int = 16
    """Rooms to learn from."""
    held_out_rooms: int = 8
    """Rooms with other photographs, cameras and noise to evaluate on."""
    views: int = 3
    """Views a room."""
    seed: int = 0
    """Of rooms, views and noise."""
    layers: int = LAYERS
    """Layers an octave of the key points; the shipped classifier was trained with 3."""

    def __post_init__(self) -> None:
        for name in ("training_rooms", "held_out_rooms", "views"):
            check_range(name.replace("_", "-"), getattr(self, name), 1, 10_000)
        check_range("layers", self.layers, 1, 20)
        check_range("seed", self.seed, 0)


@dataclass(frozen=True)
class Quality:
    """How well a classifier separates the markers that must be found from clutter."""

    average_precision: float
    """Area under precision over recall."""
    roc_area: float
    """Area under true over false positive rate."""
    recall: float
    """Share of markers at the operating point."""
    clutter_per_view: float
    """Clutter above the operating point, before alignment with the pattern."""


def samples_of(config: TrainingConfig, on_room: Callable[[], None] = lambda: None) -> tuple[Samples, Samples]:
    """Render the rooms and return training and held-out samples; `on_room` is called after each room."""

    def rendered(split: Split, rooms: int) -> Iterator[Samples]:
        for room in range(rooms):
            yield collect_samples(split, room, config.views, config.seed, config.layers)
            on_room()

    training = join_samples(list(rendered("training", config.training_rooms)))
    return training, join_samples(list(rendered("held-out", config.held_out_rooms)))


def train(samples: Samples) -> dict[str, Classifier]:
    """Return one classifier a kind: thresholds on one column, the paper's oblique line, all columns, nonlinear.

    Needs scikit-learn; without it an `InputError` says so.
    """
    if find_spec("sklearn") is None:
        raise InputError("training needs scikit-learn: pip install 'peakmark[train]'")
    return {
        "response threshold": _linear(samples, ["log_response"]),
        "VIS threshold": _linear(samples, ["vis_distance"]),
        "oblique line": _linear(samples, ["log_response", "vis_distance"]),
        "linear": _linear(samples, list(COLUMNS)),
        "nonlinear": _nonlinear(samples, list(COLUMNS)),
    }


def _linear(samples: Samples, columns: list[str]) -> Classifier:
    """Return a logistic regression."""
    from sklearn.linear_model import LogisticRegression

    mean, scale, values = _standardised(samples, columns)
    fit = LogisticRegression(C=100.0, max_iter=2000).fit(values, samples.is_marker)
    layers = (Layer(fit.coef_.T, fit.intercept_),)
    return _at_operating_point(Classifier(tuple(columns), mean, scale, layers, 0.0), samples)


def _nonlinear(samples: Samples, columns: list[str]) -> Classifier:
    """Return a network of one small hidden layer."""
    from sklearn.neural_network import MLPClassifier

    mean, scale, values = _standardised(samples, columns)
    network = MLPClassifier((HIDDEN,), activation="tanh", solver="lbfgs", alpha=1e-2, max_iter=2000, random_state=0)
    network.fit(values, samples.is_marker)
    layers = tuple(map(Layer, network.coefs_, network.intercepts_))
    return _at_operating_point(Classifier(tuple(columns), mean, scale, layers, 0.0), samples)


def _standardised(samples: Samples, columns: Sequence[str]) -> tuple[Array, Array, Array]:
    values = samples.evidence[:, [COLUMNS.index(name) for name in columns]]
    mean, scale = values.mean(axis=0), values.std(axis=0)
    return mean, scale, (values - mean) / scale


def must_be_found(samples: Samples) -> NDArray[np.bool_]:
    """Return (n,) which samples are markers as `READABLE` wants them; all markers of samples are fully in view."""
    is_large, is_square = samples.side_px >= READABLE.min_side_px, samples.tilt_deg <= READABLE.max_tilt_deg
    return samples.is_marker & is_large & is_square


def _at_operating_point(classifier: Classifier, samples: Samples) -> Classifier:
    clutter = np.sort(classifier.scores(samples.evidence)[~samples.is_marker])[::-1]
    threshold = float(clutter[min(len(clutter) - 1, round(CLUTTER * samples.views))])
    return replace(classifier, threshold=threshold)


@needs_extra
def evaluate_classifier(classifier: Classifier, samples: Samples) -> Quality:
    """Return how well a classifier separates markers (those that `must_be_found`) from clutter."""
    from sklearn.metrics import average_precision_score, roc_auc_score

    scores, labels = _scored(classifier, samples)
    above = scores > classifier.threshold
    return Quality(
        average_precision=float(average_precision_score(labels, scores)),
        roc_area=float(roc_auc_score(labels, scores)),
        recall=float(above[labels].mean()),
        clutter_per_view=float(above[~labels].sum() / samples.views),
    )


@needs_extra
def roc_rates(classifier: Classifier, samples: Samples) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return (r,) false and (r,) true positive rates over all thresholds."""
    from sklearn.metrics import roc_curve

    scores, labels = _scored(classifier, samples)
    false_rates, true_rates, _ = roc_curve(labels, scores)
    return false_rates, true_rates


def _scored(classifier: Classifier, samples: Samples) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return the scores of wanted markers and clutter, and which of them are markers."""
    is_wanted = must_be_found(samples)
    counts = is_wanted | ~samples.is_marker
    return classifier.scores(samples.evidence[counts]), is_wanted[counts]


HEAD = ("classifier", "AP", "ROC area", "recall", "clutter/view", "own AP", "own recall", "own clutter/view")
"""AP: average precision; "own": on the training rooms; recall and clutter at the operating point."""


@dataclass(frozen=True)
class SampleCounts:
    """How many samples there are."""

    views: int
    markers: int
    """Markers that must be found."""
    clutter: int
    """Other key points."""
    markers_without_key_point: int
    """Markers that must be found, but have no key point at their centre."""


@dataclass(frozen=True)
class ClassifierRecord:
    """One kind of classifier."""

    held_out: Quality
    training: Quality
    """In rooms that it was not trained on, and in its own."""
    threshold: float
    """Its operating point."""


@dataclass(frozen=True)
class TrainingResult:
    """What `result.json` holds."""

    config: TrainingConfig
    shipped: str
    """The kind that classifier.json holds."""
    training: SampleCounts
    held_out: SampleCounts
    """What was learnt from, and evaluated on."""
    classifiers: dict[str, ClassifierRecord]
    """By kind."""


def run_training(
    config: TrainingConfig, out: str | Path, is_reused: bool = False, on_room: Callable[[], None] = lambda: None
) -> TrainingResult:
    """Train and evaluate, write everything into `out`, and return what `result.json` holds.

    With `is_reused` the samples that `out` holds are taken instead of rendering rooms; without any an `InputError`.
    """
    with result_folder(out) as folder:
        if is_reused:
            training, held_out = (load_samples(Path(out) / name) for name in ("training.npz", "held_out.npz"))
        else:
            training, held_out = samples_of(config, on_room)
            save_samples(folder / "training.npz", training)
            save_samples(folder / "held_out.npz", held_out)
        classifiers = train(training)
        rows = {
            name: ClassifierRecord(evaluate_classifier(c, held_out), evaluate_classifier(c, training), c.threshold)
            for name, c in classifiers.items()
        }
        result = TrainingResult(config, SHIPPED, _counts(training), _counts(held_out), rows)
        write_json(folder / "classifier.json", {**to_plain(classifiers[SHIPPED]), "origin": _origin(result)})
        figure, ax = plots.new_figure()
        plots.roc(ax, {name: roc_rates(classifier, held_out) for name, classifier in classifiers.items()})
        plots.save(figure, folder / "roc.png")
        sections = [
            Section("Classifiers", table=Table(HEAD, table_rows(result))),
            Section("ROC on held-out rooms", image=svg_uri(figure)),
        ]
        write_report(folder / "report.html", "Key points → markers", _lead(result), sections)
        write_json(folder / "result.json", result)
    return result


def _counts(samples: Samples) -> SampleCounts:
    return SampleCounts(
        views=samples.views,
        markers=int(must_be_found(samples).sum()),
        clutter=int(np.sum(~samples.is_marker)),
        markers_without_key_point=samples.unseen,
    )


def _lead(result: TrainingResult) -> str:
    own, held = result.training, result.held_out
    return (
        f"Trained on {own.markers} markers and {own.clutter:,} other key points of {own.views} views, evaluated "
        f"on {held.markers} and {held.clutter:,} of {held.views} views of rooms with other photographs, "
        f"cameras and noise. Operating points let {CLUTTER:g} key points of clutter a training view through."
    )


def table_rows(result: TrainingResult) -> list[tuple[Any, ...]]:
    """Return one row a classifier under `HEAD`."""
    return [
        (
            name,
            *astuple(row.held_out),
            row.training.average_precision,
            row.training.recall,
            row.training.clutter_per_view,
        )
        for name, row in result.classifiers.items()
    ]


def _origin(result: TrainingResult) -> str:
    config, own = result.config, result.training
    return (
        f"scripts/train_classifier.py --training-rooms {config.training_rooms} --views {config.views} --layers "
        f"{config.layers} --seed {config.seed}: {SHIPPED}, {own.markers} markers, {own.views} views, threshold at "
        f"{CLUTTER:g} key points of clutter a view"
    )
