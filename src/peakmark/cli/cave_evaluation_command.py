"""The command behind `scripts/evaluate_cave.py`: arguments, progress, tables, report."""

from collections.abc import Sequence
from dataclasses import astuple
from pathlib import Path
from typing import Annotated, cast

from rich.console import Console
from rich.progress import Progress
from typer import Option

from peakmark.cli.terminal import print_table
from peakmark.experiments.cave.evaluation import EvaluationConfig, ViewRecord, evaluate
from peakmark.experiments.cave.evaluation_figures import BINS, bin_row, evaluation_figures, headline, recall_by
from peakmark.experiments.cave.rooms import Split
from peakmark.plain import plain_fields
from peakmark.report.page import Section, Table, write_report
from peakmark.report.results import result_folder, write_json

HEAD = ("figure", "value", "low", "high", "of")


def evaluate_cave(
    out: Annotated[Path, Option(help="Folder for the results; made if missing.")] = Path("out/cave_evaluation"),
    rooms: Annotated[int, Option(help="Random rooms.")] = EvaluationConfig.rooms,
    views: Annotated[int, Option(help="Random cameras a room.")] = EvaluationConfig.views,
    split: Annotated[str, Option(help="held-out, or training to tune on.")] = EvaluationConfig.split,
    size: Annotated[float, Option(help="Share of the cameras' width and height.")] = EvaluationConfig.size,
    seed: Annotated[int, Option(help="Seed of rooms, cameras and noise.")] = EvaluationConfig.seed,
    workers: Annotated[int, Option(help="Processes.")] = 1,
    quiet: Annotated[bool, Option("--quiet", help="Print nothing but errors.")] = False,
) -> None:
    """Read random views (0.5–4 m, tilt to 45°, any roll, noise, blur) of rooms never used for tuning, and score them.

    Writes report.html and result.json, and keeps each finished room in journal.jsonl: started again with the same
    arguments, or with more rooms, it resumes where it stopped.
    """
    config = EvaluationConfig(rooms, views, cast(Split, split), size, seed)
    console = Console(quiet=quiet)
    with Progress(console=console, transient=True, disable=quiet) as progress:
        task = progress.add_task("render, read, score", total=rooms)
        records = evaluate(config, out, workers, lambda done, of: progress.update(task, completed=done))
    write_evaluation(config, records, out)
    print_table(console, f"{split} rooms · seed {seed}", HEAD, headline(evaluation_figures(records)))
    console.print(f"Results: {out / 'report.html'}", soft_wrap=True)


def write_evaluation(config: EvaluationConfig, records: Sequence[ViewRecord], out: Path) -> None:
    """Write report.html and result.json."""
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
