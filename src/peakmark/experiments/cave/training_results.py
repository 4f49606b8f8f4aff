"""Trains and evaluates the classifiers, and writes classifier.json, roc.png, samples, report.html and result.json."""

from collections.abc import Callable
from dataclasses import astuple, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from peakmark.experiments.cave.samples import Samples, load_samples, save_samples
from peakmark.experiments.cave.training import (
    CLUTTER,
    SHIPPED,
    Quality,
    TrainingConfig,
    evaluate_classifier,
    must_be_found,
    roc_rates,
    samples_of,
    train,
)
from peakmark.plain import to_plain
from peakmark.report import plots
from peakmark.report.page import Section, Table, svg_uri, write_report
from peakmark.report.results import result_folder, write_json

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
