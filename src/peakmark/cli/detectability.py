"""The command behind `scripts/detectability.py`: the run, its tables and figures, and what the terminal shows."""

import csv
from collections.abc import Sequence
from dataclasses import asdict
from io import StringIO
from pathlib import Path
from typing import Annotated

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeRemainingColumn
from typer import Option

from peakmark.experiments.detectability.claims import claims_table
from peakmark.experiments.detectability.curves import curve_figures
from peakmark.experiments.detectability.figures import fixed_figures
from peakmark.experiments.detectability.measure import finished_rows, measure_points, open_journal
from peakmark.experiments.detectability.points import DetectabilityConfig
from peakmark.experiments.detectability.tables import envelope_lines, envelope_table, gains_table
from peakmark.experiments.detectability.trials import Row
from peakmark.experiments.journal import Journal
from peakmark.report import plots
from peakmark.report.page import Section, Table, svg_file_uri, write_report
from peakmark.report.results import result_folder, write_json

QUICK = {"trials": 8, "every": 4}
"""What --quick sets: about a minute on two cores."""


def detectability(
    out: Annotated[Path, Option(help="Folder for the results; an interrupted run there resumes.")] = Path(
        "out/detectability"
    ),
    trials: Annotated[int, Option(help="Random phases and rotations a point.")] = 100,
    every: Annotated[int, Option(help="Take each n-th value of every axis.")] = 1,
    quick: Annotated[bool, Option("--quick", help="A coarse look in about a minute.")] = False,
    paper: Annotated[bool, Option("--paper", help="One centred image a point, as the paper has it.")] = False,
    only: Annotated[list[str] | None, Option(help="Experiments to run, by name; may be repeated.")] = None,
    detector: Annotated[list[str] | None, Option(help="A further detector by name; may be repeated.")] = None,
    workers: Annotated[int | None, Option(help="Processes. [default: one a core]")] = None,
    report_only: Annotated[bool, Option("--report-only", help="Measure nothing; report what is finished.")] = False,
    seed: Annotated[int, Option(help="Of phases, rotations and noise.")] = 0,
    quiet: Annotated[bool, Option("--quiet", help="Print nothing but errors.")] = False,
) -> None:
    """Redo the experiments of Section 4.1 with intervals: scale, rotation, tilt, noise, blur, compression, light.

    Writes rows.csv with the configuration in result.json, figures 1 to 9 as PNG and SVG, report.html, and
    envelope.csv for `peakmark envelope --rates`.
    """
    amount = QUICK if quick else {"trials": trials, "every": every}
    config = DetectabilityConfig(
        **amount, seed=seed, only=tuple(only or ()), extra=tuple(detector or ()), is_paper=paper
    )
    console = Console(quiet=quiet)
    journal = open_journal(config, out)
    rows = finished_rows(config, journal) if report_only else _run_with_progress(config, journal, workers, console)
    write_results(out, config, rows)
    console.print(f"Results: {out / 'report.html'}", soft_wrap=True)


def _run_with_progress(
    config: DetectabilityConfig, journal: Journal, workers: int | None, console: Console
) -> list[Row]:
    columns = ("[progress.description]{task.description}", BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True, disable=console.quiet) as progress:
        task = progress.add_task("points", total=None)
        return measure_points(
            config, journal, workers, lambda done, of: progress.update(task, completed=done, total=of)
        )


def write_results(out: Path, config: DetectabilityConfig, rows: Sequence[Row]) -> None:
    """Write rows.csv, envelope.csv, figures, report.html and result.json."""
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
        images = {name.replace("-", " ").capitalize(): svg_file_uri(folder / f"{name}.svg") for name in figures}
        sections = [Section(title, table=table) for title, table in tables.items()]
        sections += [Section(title, image=uri) for title, uri in images.items()]
        faults = fault_rows(rows)
        sections += [Section("Faults of detectors", table=faults)] if faults.rows else []
        lead = (
            f"{config.trials} random phases and rotations a point, seed {config.seed}; intervals are Wilson's at 95 %."
        )
        write_report(folder / "report.html", "Detectability of SIFT and SURF markers", lead, sections)
        plain = {title: [dict(zip(t.head, row, strict=True)) for row in t.rows] for title, t in tables.items()}
        write_json(folder / "result.json", {"config": asdict(config), "points": len(rows), "tables": plain})


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
