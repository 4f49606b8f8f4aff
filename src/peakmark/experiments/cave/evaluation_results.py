"""Results of an evaluation of the CAVE: report.html and result.json."""

from collections.abc import Sequence
from dataclasses import astuple
from pathlib import Path

from peakmark.experiments.cave.evaluation import EvaluationConfig, ViewRecord
from peakmark.experiments.cave.evaluation_figures import (
    BINS,
    EvaluationFigures,
    bin_row,
    evaluation_figures,
    headline,
    recall_by,
)
from peakmark.plain import plain_fields
from peakmark.report.page import Section, Table, write_report
from peakmark.report.results import result_folder, write_json

HEAD = ("figure", "value", "low", "high", "of")


def write_evaluation(config: EvaluationConfig, records: Sequence[ViewRecord], out: Path) -> EvaluationFigures:
    """Write report.html and result.json, and return the figures."""
    by = {quantity: recall_by(records, quantity) for quantity in BINS}
    figures = evaluation_figures(records)
    lead = (
        f"{figures.views} random views of {config.rooms} {config.split} rooms, images at "
        f"{config.size:g} of their cameras' width and height, seed {config.seed}. Wanted: "
        "markers and arrays wholly in view, 20 px or larger, tilted to 45°. Intervals: 95 %."
    )
    sections = [Section("Figures", table=Table(HEAD, headline(figures)))]
    sections += [
        Section(
            f"All markers fully in view, by {name}",
            table=Table(
                ("from", "to", *HEAD[1:], "error p95 (px)"),
                [(row.low, row.high, *astuple(row.recall), row.error_px[95]) for row in rows],
            ),
        )
        for name, rows in by.items()
    ]
    bins = {name: [bin_row(row) for row in rows] for name, rows in by.items()}
    with result_folder(out) as folder:
        write_report(folder / "report.html", "SIFT/SURF CAVE: random views", lead, sections)
        write_json(folder / "result.json", {**plain_fields(figures), "recall_by": bins, "config": config})
    return figures
