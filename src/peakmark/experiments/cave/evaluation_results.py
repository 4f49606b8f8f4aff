"""Results of an evaluation of the CAVE: report.html and result.json."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

from peakmark.experiments.cave.evaluation import EvaluationConfig
from peakmark.experiments.cave.evaluation_figures import figures, headline, recall_by
from peakmark.report.page import Section, Table, write_report
from peakmark.report.results import result_folder, write_json

HEAD = ("figure", "value", "low", "high", "of")


def write_evaluation(config: EvaluationConfig, records: list[dict[str, Any]], out: Path) -> dict[str, Any]:
    """Write report.html and result.json, and return what the latter holds."""
    by = {quantity: recall_by(records, quantity) for quantity in ("side_px", "tilt_deg")}
    result = {**figures(records), "recall_by": by, "config": asdict(config)}
    lead = (
        f"{result['views']} random views of {config.rooms} {config.split} rooms, images at "
        f"{config.size:g} of their cameras' width and height, seed {config.seed}. Asked for: "
        "markers and arrays wholly in view, 20 px or larger, tilted to 45°. Intervals: 95 %."
    )
    sections = [Section("Figures", table=Table(HEAD, headline(result)))]
    sections += [
        Section(
            f"All markers fully in view, by {name}",
            table=Table(
                ("from", "to", *HEAD[1:], "error p95 (px)"),
                [(row["low"], row["high"], *row["recall"].values(), row["error_px_p95"]) for row in rows],
            ),
        )
        for name, rows in by.items()
    ]
    with result_folder(out) as folder:
        write_report(folder / "report.html", "SIFT/SURF CAVE: random views", lead, sections)
        write_json(folder / "result.json", result)
    return result
