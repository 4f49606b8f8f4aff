"""The command that compares our markers with tags, rings and corners: arguments, progress, what the terminal shows."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

from typer import Option

from peakmark.cli.command import examples, resumable
from peakmark.cli.options import Out, Quiet
from peakmark.cli.terminal import new_console, print_path, print_table, progress_bar
from peakmark.experiments.comparison import results
from peakmark.experiments.comparison.comparison import QUICK, ComparisonConfig, compare
from peakmark.experiments.comparison.figures import figures_of


@examples(
    "peakmark compare --quick --out out/quick", "peakmark compare --workers 2 --folder my_images --out out/comparison"
)
def compare_designs(
    out: Out = Path("out/comparison"),
    quick: Annotated[bool, Option("--quick", help="Few frames: three minutes.")] = False,
    frames: Annotated[
        int | None, Option(help=f"Boards a value of each sweep. [default: {ComparisonConfig.frames}]")
    ] = None,
    folder: Annotated[
        Path | None, Option(help="Images with truth.json, or a corpus, as one more set; see evaluate_images.py.")
    ] = None,
    seed: Annotated[int, Option(help="Seed of boards, walls, cameras and noise.")] = 0,
    workers: Annotated[int, Option(help="Processes.")] = 1,
    quiet: Quiet = False,
) -> None:
    """Compare markers and arrays with AprilTag, ArUco, rings and corners of one printed area, in the same frames.

    Binary markers, SIFT's and discs are among them. Frames are rendered over size, tilt, noise, blur, shadow, light and
    cover, path-traced, and warped into photographs; others hold one print, by render-tag's recipe, or none. Writes
    index.md and report.html (who wins, shares with intervals, centres, poses, processor time), rates.png and data.json;
    an interrupted run resumes. Needs the extras compare and train.
    """
    config = replace(QUICK if quick else ComparisonConfig(), seed=seed, folder=folder)
    config = config if frames is None else replace(config, frames=frames)
    console = new_console(quiet)
    with resumable(), progress_bar(console, "render, read, score") as bar:
        measured = compare(config, out, workers, bar.show)
    command = "peakmark compare" + (" --quick" if quick else "") + ("" if frames is None else f" --frames {frames}")
    figures = figures_of(measured, command + (" --folder FOLDER" if folder else "") + f" --seed {seed}", seed)
    results.write_comparison(figures, out)
    print_table(console, "who wins", results.VERDICT_HEAD, results.verdict_rows(figures))
    print_path(console, out / "report.html")
