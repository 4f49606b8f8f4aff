"""The command that evaluates `identify` and its peers on a folder of images."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated, cast

from typer import Argument, Option

from peakmark.cli.command import examples, resumable
from peakmark.cli.options import Out, Quiet, UnusedSeed
from peakmark.cli.terminal import FIGURES_WITH_INTERVALS, new_console, print_path, print_table, progress_bar
from peakmark.experiments.images.evaluation import evaluate_folder, summarise
from peakmark.experiments.images.peers import PEERS
from peakmark.experiments.images.results import HEAD, figure_rows, rate_rows, write_evaluation
from peakmark.experiments.images.truth import Sought, read_set
from peakmark.experiments.journal import Journal
from peakmark.markers.optimum import Limit


@examples(
    "python scripts/evaluate_images.py photographs", "python scripts/evaluate_images.py set --peers --out out/set"
)
def evaluate_images(
    folder: Annotated[
        Path, Argument(help="Images with truth.json, a finished corpus, or photographs without markers.")
    ],
    out: Out = Path("out/images"),
    peers: Annotated[
        bool, Option("--peers", help="Also AprilTag's own library and OpenCV's on the tags in the images.")
    ] = False,
    detector: Annotated[str, Option(help="surf, sift, vlfeat or surf-disc: whose markers are looked for.")] = "surf",
    limit: Annotated[str | None, Option(help="energy, range (binary markers; for sift discs) or both.")] = None,
    workers: Annotated[int, Option(help="Processes.")] = 1,
    seed: UnusedSeed = 0,
    quiet: Quiet = False,
) -> None:
    """Score identify and decode_arrays on a folder of images, beside AprilTag in the same images.

    Writes report.html with shares by size, tilt, condition and sensor and every fault as a crop, rates.png and
    result.json; an interrupted run resumes.
    """
    sought = Sought(detector, cast(Limit | None, limit))
    images = read_set(folder, sought)
    chosen = PEERS if peers else ()
    settings = {"folder": str(folder.resolve()), "images": len(images.images), "peers": list(chosen)}
    journal = Journal.open(out, settings | asdict(sought))
    console = new_console(quiet)
    with resumable(), progress_bar(console, "identify") as bar:
        outcomes = evaluate_folder(folder, chosen, journal, workers, bar.show, sought)
    found = summarise(images.images, outcomes)
    write_evaluation(out, str(folder), images, outcomes, found)
    journal.remove()
    print_table(console, f"{found.images} images", HEAD, rate_rows(found))
    print_table(console, "", FIGURES_WITH_INTERVALS, figure_rows(found))
    print_path(console, out / "report.html")
