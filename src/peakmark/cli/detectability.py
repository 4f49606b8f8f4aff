"""`peakmark detectability`: arguments, progress, and what the terminal shows."""

from pathlib import Path
from typing import Annotated

from typer import Option

from peakmark.cli.command import examples, resumable
from peakmark.cli.options import Quiet
from peakmark.cli.terminal import new_console, print_path, progress_bar
from peakmark.experiments.detectability.measure import finished_rows, measure_points, open_journal
from peakmark.experiments.detectability.points import DetectabilityConfig
from peakmark.experiments.detectability.results import write_results

QUICK = {"trials": 8, "every": 4}
"""What --quick sets: about a minute on two cores."""


@examples("peakmark detectability --quick", "peakmark detectability --only scale --detector cv2:ORB --workers 2")
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
    quiet: Quiet = False,
) -> None:
    """Redo the experiments of Section 4.1 with intervals: scale, rotation, tilt, noise, blur, compression, light.

    Writes rows.csv with the configuration in result.json, figures 1 to 9 as PNG and SVG, report.html, and
    envelope.csv for `peakmark envelope --rates`.
    """
    amount = QUICK if quick else {"trials": trials, "every": every}
    config = DetectabilityConfig(
        **amount, seed=seed, only=tuple(only or ()), extra=tuple(detector or ()), is_paper=paper
    )
    console = new_console(quiet)
    journal = open_journal(config, out)
    if report_only:
        rows = finished_rows(config, journal)
    else:
        with resumable(), progress_bar(console, "points") as bar:
            rows = measure_points(config, journal, workers, bar.show)
    write_results(out, config, rows)
    print_path(console, out / "report.html")
