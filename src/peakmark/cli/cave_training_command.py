"""The command behind `scripts/train_classifier.py`: arguments, progress, and what the terminal shows."""

from pathlib import Path
from typing import Annotated

from rich.console import Console
from rich.progress import Progress
from typer import Option

from peakmark.cli.terminal import print_table
from peakmark.experiments.cave.training import TrainingConfig
from peakmark.experiments.cave.training_results import HEAD, run_training, table_rows


def train_classifier(
    out: Annotated[Path, Option(help="Folder for the results; made if missing.")] = Path("out/classifier"),
    training_rooms: Annotated[int, Option(help="Random rooms to learn from.")] = TrainingConfig.training_rooms,
    held_out_rooms: Annotated[
        int, Option(help="Random rooms with other photographs, cameras and noise to evaluate on.")
    ] = TrainingConfig.held_out_rooms,
    views: Annotated[int, Option(help="Random cameras a room.")] = TrainingConfig.views,
    layers: Annotated[int, Option(help="Layers an octave of the key points.")] = TrainingConfig.layers,
    seed: Annotated[int, Option(help="Seed of rooms, cameras and noise.")] = TrainingConfig.seed,
    reuse: Annotated[bool, Option("--reuse", help="Take the samples that --out holds; render nothing.")] = False,
    quiet: Annotated[bool, Option("--quiet", help="Print nothing but errors.")] = False,
) -> None:
    """Train the classifiers of key points on rendered rooms and evaluate them on others (the paper's Section 5).

    Writes classifier.json (the kind that ships), roc.png, training.npz, held_out.npz, report.html and result.json.
    """
    config = TrainingConfig(training_rooms, held_out_rooms, views, seed, layers)
    console = Console(quiet=quiet)
    with Progress(console=console, transient=True, disable=quiet) as progress:
        task = progress.add_task("render rooms", total=training_rooms + held_out_rooms)
        result = run_training(config, out, reuse, lambda: progress.update(task, advance=1))
    print_table(console, "evaluated on held-out rooms", HEAD, table_rows(result))
    console.print(f"Results: {out / 'report.html'}", soft_wrap=True)
