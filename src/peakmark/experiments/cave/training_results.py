"""Trains and judges the classifiers, and writes classifier.json, roc.png, samples, report.html and result.json."""

from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from peakmark.experiments.cave.samples import Samples, load_samples, save_samples
from peakmark.experiments.cave.training import (
    CLUTTER,
    SHIPPED,
    Judgement,
    TrainingConfig,
    judge,
    required,
    samples_of,
    train,
)
from peakmark.identification.classifier import Classifier
from peakmark.report import plots
from peakmark.report.page import Section, Table, svg_uri, write_report
from peakmark.report.results import result_folder, write_json

HEAD = ("classifier", "AP", "ROC area", "recall", "clutter/view", "own AP", "own recall", "own clutter/view")
"""AP: average precision; "own": on the training rooms; recall and clutter at the operating point."""


def run(
    config: TrainingConfig, out: str | Path, is_reused: bool = False, on_room: Callable[[], None] = lambda: None
) -> dict[str, Any]:
    """Train and judge, write everything into `out`, and return what `result.json` holds.

    With `is_reused` the samples that `out` holds are taken instead of rendering rooms.

    Raises
    ------
    InputError
        If `out` cannot be written, or holds no samples to reuse.
    """
    with result_folder(out) as folder:
        if is_reused:
            training, held_out = (load_samples(Path(out) / name) for name in ("training.npz", "held_out.npz"))
        else:
            training, held_out = samples_of(config, on_room)
            save_samples(folder / "training.npz", training)
            save_samples(folder / "held_out.npz", held_out)
        classifiers = train(training)
        judgements = {name: (judge(c, held_out), judge(c, training)) for name, c in classifiers.items()}
        result = _result(config, training, held_out, classifiers, judgements)
        write_json(folder / "classifier.json", {**classifiers[SHIPPED].to_json(), "origin": _origin(config, training)})
        figure, ax = plots.new_figure()
        curves = {name: (j.false_positive_rate, j.true_positive_rate) for name, (j, _) in judgements.items()}
        plots.roc(ax, curves)
        plots.save(figure, folder / "roc.png")
        sections = [
            Section("Classifiers", table=Table(HEAD, table_rows(result))),
            Section("ROC on held-out rooms", image=svg_uri(figure)),
        ]
        write_report(folder / "report.html", "Key points → markers", _lead(result), sections)
        write_json(folder / "result.json", result)
    return result


def _lead(result: dict[str, Any]) -> str:
    own, held = result["training"], result["held_out"]
    return (
        f"Trained on {own['markers']} markers and {own['clutter']:,} other key points of {own['views']} views, judged "
        f"on {held['markers']} and {held['clutter']:,} of {held['views']} views of rooms with other photographs, "
        f"cameras and noise. Operating points let {CLUTTER:g} key points of clutter a training view through."
    )


def table_rows(result: dict[str, Any]) -> list[tuple[Any, ...]]:
    """Return one row a classifier under `HEAD`."""
    keys = ("average_precision", "roc_area", "recall", "clutter_per_view")
    training_keys = ("average_precision", "recall", "clutter_per_view")
    return [
        (name, *(row["held_out"][key] for key in keys), *(row["training"][key] for key in training_keys))
        for name, row in result["classifiers"].items()
    ]


def _origin(config: TrainingConfig, training: Samples) -> str:
    return (
        f"scripts/train_classifier.py --training-rooms {config.training_rooms} --views {config.views} --seed "
        f"{config.seed}: {SHIPPED}, {int(required(training).sum())} markers, {training.views} views, threshold at "
        f"{CLUTTER:g} key points of clutter a view"
    )


def _result(
    config: TrainingConfig,
    training: Samples,
    held_out: Samples,
    classifiers: dict[str, Classifier],
    judgements: dict[str, tuple[Judgement, Judgement]],
) -> dict[str, Any]:
    rows = {
        name: {"held_out": _figures(held), "training": _figures(own), "threshold": classifiers[name].threshold}
        for name, (held, own) in judgements.items()
    }
    return {
        "config": asdict(config),
        "shipped": SHIPPED,
        "training": _counts(training),
        "held_out": _counts(held_out),
        "classifiers": rows,
    }


def _counts(samples: Samples) -> dict[str, int]:
    return {
        "views": samples.views,
        "markers": int(required(samples).sum()),
        "clutter": int(np.sum(~samples.is_marker)),
        "markers_without_key_point": samples.unseen,
    }


def _figures(judgement: Judgement) -> dict[str, float]:
    return {
        "average_precision": judgement.average_precision,
        "roc_area": judgement.roc_area,
        "recall": judgement.recall,
        "clutter_per_view": judgement.false_positives_per_view,
    }
