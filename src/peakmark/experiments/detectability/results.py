"""Results of a run: rows.csv, envelope.csv, figures, report.html, tables.md and result.json."""

import csv
from collections.abc import Sequence
from dataclasses import asdict
from io import StringIO
from pathlib import Path

from peakmark.experiments.detectability.claims import claims_table
from peakmark.experiments.detectability.curves import curve_figures
from peakmark.experiments.detectability.figures import fixed_figures
from peakmark.experiments.detectability.points import DetectabilityConfig
from peakmark.experiments.detectability.tables import envelope_lines, envelope_table, gains_table
from peakmark.experiments.detectability.trials import Row
from peakmark.report import plots
from peakmark.report.page import Section, Table, markdown_table, svg_file_uri, write_report
from peakmark.report.results import result_folder, write_json


def write_results(out: Path, config: DetectabilityConfig, rows: Sequence[Row]) -> None:
    """Write rows.csv, envelope.csv, figures, report.html, tables.md (the report's tables) and result.json."""
    tables = {
        "The paper's claims": claims_table(rows),
        "Operating envelope": envelope_table(rows),
        "Gain of the range-limited markers": gains_table(rows),
    }
    with result_folder(out) as folder:
        (folder / "rows.csv").write_text(as_csv(rows), encoding="utf-8")
        (folder / "envelope.csv").write_text("\n".join(envelope_lines(rows)) + "\n", encoding="utf-8")
        figures = fixed_figures(config.seed) | curve_figures(rows)
        for name, figure in figures.items():
            for ending in ("png", "svg"):
                plots.save(figure, folder / f"{name}.{ending}")
        uris = {name.replace("-", " ").capitalize(): svg_file_uri(folder / f"{name}.svg") for name in figures}
        sections = [Section(title, table=table) for title, table in tables.items()]
        sections += [Section(title, image=uri) for title, uri in uris.items()]
        faults = fault_rows(rows)
        sections += [Section("Faults of detectors", table=faults)] if faults.rows else []
        title = "Detectability of SIFT and SURF markers"
        write_report(folder / "report.html", title, lead(config), sections)
        texts = [f"## {name}\n\n{markdown_table(table.head, table.rows)}\n" for name, table in tables.items()]
        (folder / "tables.md").write_text("\n".join(texts), encoding="utf-8")
        plain = {title: [dict(zip(t.head, row, strict=True)) for row in t.rows] for title, t in tables.items()}
        write_json(folder / "result.json", {"config": asdict(config), "points": len(rows), "tables": plain})


def lead(config: DetectabilityConfig) -> str:
    """Return how many images of a point were taken."""
    if config.is_paper:
        return "One centred image a point, as the paper has it: a rate is 0 or 1, and there are no intervals."
    return f"{config.trials} random phases and rotations a point, seed {config.seed}; intervals are Wilson's at 95 %."


def as_csv(rows: Sequence[Row]) -> str:
    """Return the rows as CSV text; None is empty."""
    text = StringIO()
    writer = csv.DictWriter(text, fieldnames=list(rows[0].columns()), lineterminator="\n")
    writer.writeheader()
    writer.writerows(row.columns() for row in rows)
    return text.getvalue()


def fault_rows(rows: Sequence[Row]) -> Table:
    """Return the detectors that raised or gave unusable key points, with counts."""
    head = ("detector", "experiment", "x", "raised", "not finite", "outside", "first exception")
    names = ("detector", "experiment", "x", "failures", "not_finite", "outside", "first_failure")
    faulty = [row for row in rows if row.found.failures or row.found.not_finite or row.found.outside]
    return Table(head, [[row.columns()[name] for name in names] for row in faulty])
