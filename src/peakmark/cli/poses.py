"""The command that measures poses and their covariance."""

from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Annotated

from rich.table import Table
from typer import Option

from peakmark.cli.command import examples, resumable
from peakmark.cli.options import Out, Quiet
from peakmark.cli.terminal import new_console, print_path, progress_bar
from peakmark.experiments.journal import Journal
from peakmark.experiments.poses.figures import HEAD, figure_row, pose_figures
from peakmark.experiments.poses.study import PoseError, PoseStudyConfig, measured
from peakmark.experiments.run import run_items
from peakmark.plain import from_plain
from peakmark.report.results import result_folder, write_json


@examples(
    "python scripts/evaluate_poses.py --workers 2", "python scripts/evaluate_poses.py --clean 6 --warped 6 --traced 0"
)
def evaluate_poses(
    out: Out = Path("out/evaluate-poses"),
    clean: Annotated[int | None, Option(help=f"Images rendered exactly. [default: {PoseStudyConfig.clean}]")] = None,
    warped: Annotated[
        int | None, Option(help=f"Boards warped into photographs. [default: {PoseStudyConfig.warped}]")
    ] = None,
    traced: Annotated[int | None, Option(help=f"Path-traced images. [default: {PoseStudyConfig.traced}]")] = None,
    seed: Annotated[int, Option(help="Seed of boards, walls, cameras, light and noise.")] = PoseStudyConfig.seed,
    workers: Annotated[int, Option(help="Processes.")] = 1,
    quiet: Quiet = False,
) -> None:
    """Measure poses from one array, several, loose markers, and all together, and whether their covariance is honest.

    Writes result.json: errors, normalised errors and the share of truths in the stated 95 % ellipsoid, with 95 %
    intervals; an interrupted run resumes.
    """
    given = {"clean": clean, "warped": warped, "traced": traced}
    config = replace(PoseStudyConfig(seed=seed), **{name: count for name, count in given.items() if count is not None})
    console = new_console(quiet)
    journal = Journal.open(out, {"seed": seed})
    names = [f"{name} {number}" for name, number in config.frames]
    with resumable(), progress_bar(console, "render, find, locate") as bar:
        records = run_items(journal, names, partial(measured, config), workers, bar.show)
    poses = [
        (name, from_plain(PoseError, each))
        for (name, _), record in zip(config.frames, records, strict=True)
        for each in record
    ]
    rows = pose_figures(poses)
    with result_folder(out) as folder:
        write_json(folder / "result.json", {"config": asdict(config), "poses": [asdict(row) for row in rows]})
    table = Table(*HEAD)
    for row in rows:
        table.add_row(*figure_row(row))
    console.print(table)
    print_path(console, out / "result.json", "Result")
