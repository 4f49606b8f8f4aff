"""The command behind `scripts/evaluate_flights.py`."""

from pathlib import Path
from typing import Annotated

from rich.console import Console
from typer import Option

from peakmark.cli.terminal import print_table
from peakmark.errors import InputError
from peakmark.experiments.floor.flights import FLIGHTS
from peakmark.experiments.floor.flights_results import headline, run_flights


def evaluate_flights(
    out: Annotated[Path, Option(help="Folder for the results; each flight gets a folder in it.")] = Path("out/flights"),
    frames: Annotated[int | None, Option(help="Frames of each flight, from its start. [default: all]")] = None,
    first: Annotated[int, Option(help="Only so many of the ten flights.")] = len(FLIGHTS),
    seed: Annotated[int, Option(help="Added to the seed of each flight.")] = 0,
    resume: Annotated[bool, Option("--resume", help="Keep what an interrupted run finished.")] = False,
    quiet: Annotated[bool, Option("--quiet", help="Print nothing but errors.")] = False,
) -> None:
    """Measure finding markers over ten flights on floors never tuned for, and on pictures without any marker.

    Recall, precision, distance and poses by side, tilt and distance, with intervals; the same frames under several
    stretches. Writes report.html, result.json and the results of each flight.
    """
    if not 1 <= first <= len(FLIGHTS) or seed < 0:
        raise InputError(f"expected --first 1…{len(FLIGHTS)} and --seed 0 or more, got {first} and {seed}")
    console = Console(quiet=quiet)
    chosen = [(ride, floor, own + seed) for ride, floor, own in FLIGHTS[:first]]
    result = run_flights(out, frames, resume, chosen, console.print)
    print_table(console, f"{first} flights", ("figure", "value", "low", "high", "of"), headline(result))
    console.print(f"Results: {out / 'report.html'}", soft_wrap=True)
