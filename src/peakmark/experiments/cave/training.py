"""Classifiers of key points, trained on rendered rooms and judged on others (the paper's Section 5)."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray

from peakmark.errors import InputError
from peakmark.experiments.cave.samples import Samples, collect, joined
from peakmark.identification.classifier import COLUMNS, Classifier

SHIPPED = "linear"
"""Kind that `classifier.json` holds."""

CLUTTER = 10.0
"""Key points of clutter a view that the operating point lets through in the training rooms: alignment with the pattern
removes them, and what it costs sets the budget. Training markers lie far above it, which is the reserve for cameras
and noise that were never trained on."""

HIDDEN = 8
"""Units of the nonlinear classifier."""


@dataclass(frozen=True)
class TrainingConfig:
    """How many rooms to render."""

    training_rooms: int = 16
    """Rooms to learn from."""
    held_out_rooms: int = 8
    """Rooms with other photographs, cameras and noise to judge on."""
    views: int = 3
    """Views a room."""
    seed: int = 0
    """Of rooms, views and noise."""

    def __post_init__(self) -> None:
        for name in ("training_rooms", "held_out_rooms", "views"):
            if not 1 <= getattr(self, name) <= 10_000:
                raise InputError(f"--{name.replace('_', '-')}: expected 1…10000, got {getattr(self, name)}")
        if self.seed < 0:
            raise InputError(f"--seed: expected 0 or more, got {self.seed}")


@dataclass(frozen=True)
class Judgement:
    """A classifier on samples that it was not trained on."""

    average_precision: float
    """Area under precision over recall."""
    roc_area: float
    """Area under true over false positive rate."""
    recall: float
    """Share of markers at the operating point."""
    false_positives_per_view: float
    """Clutter above the operating point, before alignment with the pattern."""
    false_positive_rate: NDArray[np.float64]
    """(r,) of the ROC."""
    true_positive_rate: NDArray[np.float64]
    """(r,) of the ROC."""


def samples_of(config: TrainingConfig, on_room: Callable[[], None] = lambda: None) -> tuple[Samples, Samples]:
    """Render the rooms and return training and held-out samples; `on_room` is called after each room."""
    splits = (("training", config.training_rooms), ("held-out", config.held_out_rooms))
    parts: list[list[Samples]] = [[], []]
    for part, (split, rooms) in zip(parts, splits, strict=True):
        for room in range(rooms):
            part.append(collect(split, [room], config.views, config.seed))  # type: ignore[arg-type]
            on_room()
    return joined(parts[0]), joined(parts[1])


def train(samples: Samples) -> dict[str, Classifier]:
    """Return one classifier a kind: thresholds on one column, the paper's oblique line, all columns, nonlinear.

    Raises
    ------
    InputError
        If scikit-learn is not installed.
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
    return _at_operating_point(Classifier(tuple(columns), mean, scale, ((fit.coef_.T, fit.intercept_),), 0.0), samples)


def _nonlinear(samples: Samples, columns: list[str]) -> Classifier:
    """Return a network of one small hidden layer."""
    from sklearn.neural_network import MLPClassifier

    mean, scale, values = _standardised(samples, columns)
    network = MLPClassifier((HIDDEN,), activation="tanh", solver="lbfgs", alpha=1e-2, max_iter=2000, random_state=0)
    network.fit(values, samples.is_marker)
    layers = tuple(zip(network.coefs_, network.intercepts_, strict=True))
    return _at_operating_point(Classifier(tuple(columns), mean, scale, layers, 0.0), samples)


def _standardised(samples: Samples, columns: Sequence[str]) -> tuple[Any, Any, Any]:
    values = samples.evidence[:, [COLUMNS.index(name) for name in columns]]
    mean, scale = values.mean(axis=0), values.std(axis=0)
    return mean, scale, (values - mean) / scale


def required(samples: Samples) -> NDArray[np.bool_]:
    """Return (n,) which samples are markers of at least 20 px, tilted to at most 45°."""
    with np.errstate(invalid="ignore"):
        return samples.is_marker & (samples.side_px >= 20) & (samples.tilt_deg <= 45)


def _at_operating_point(classifier: Classifier, samples: Samples) -> Classifier:
    clutter = np.sort(classifier.scores(samples.evidence)[~samples.is_marker])[::-1]
    threshold = float(clutter[min(len(clutter) - 1, round(CLUTTER * samples.views))])
    return replace(classifier, threshold=threshold)


def judge(classifier: Classifier, samples: Samples) -> Judgement:
    """Return how a classifier separates markers (those of `required`) from clutter."""
    from sklearn.metrics import average_precision_score, roc_auc_score, roc_curve

    wanted = required(samples)
    asked = wanted | ~samples.is_marker
    scores, labels = classifier.scores(samples.evidence[asked]), wanted[asked]
    false_rate, true_rate, _ = roc_curve(labels, scores)
    above = scores > classifier.threshold
    return Judgement(
        average_precision=float(average_precision_score(labels, scores)),
        roc_area=float(roc_auc_score(labels, scores)),
        recall=float(above[labels].mean()),
        false_positives_per_view=float(above[~labels].sum() / samples.views),
        false_positive_rate=false_rate,
        true_positive_rate=true_rate,
    )
