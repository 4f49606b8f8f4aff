"""The commands behind the scripts of the SIFT/SURF CAVE: arguments, progress, and what the terminal shows."""

from pathlib import Path
from typing import Annotated, cast

from typer import Option

from peakmark.cli.command import examples, resumable
from peakmark.cli.options import Bake, NoiseSeed, Out, Quiet, RoomsSeed, RoomViews, Samples, SensorName, drawn_by
from peakmark.cli.terminal import FIGURES, FIGURES_WITH_INTERVALS, new_console, print_path, print_table, progress_bar
from peakmark.experiments.cave import polarity, training, walk_results
from peakmark.experiments.cave.dense_wall import compare_walls
from peakmark.experiments.cave.evaluation import EvaluationConfig, evaluate
from peakmark.experiments.cave.evaluation_results import headline, write_evaluation
from peakmark.experiments.cave.finding import CaveRule
from peakmark.experiments.cave.rooms import Split
from peakmark.experiments.cave.training import TrainingConfig
from peakmark.experiments.cave.walk import CaveConfig
from peakmark.experiments.option import check_range
from peakmark.markers.patterns import Made


@examples("peakmark cave --out out/cave", "peakmark cave --frames 40 --out out/walk")
def render_cave(
    scene: Annotated[str, Option(help="Scene file, or the name of a shipped scene.")] = CaveConfig.scene,
    out: Out = Path("out/cave"),
    renderer: Annotated[str, Option(help="exact, gl, pyrender, traced (Mitsuba) or auto.")] = CaveConfig.renderer,
    samples: Samples = CaveConfig.samples,
    sensor: SensorName = None,
    bake: Bake = True,
    seed: NoiseSeed = CaveConfig.seed,
    frames: Annotated[
        int, Option(help="Frames of a walk through the room, each scored; more than 1 also makes a film.")
    ] = CaveConfig.frames,
    marker: Annotated[str, Option(help="surf, or sift: SIFT's markers on the walls.")] = CaveConfig.marker,
    rule: Annotated[
        str, Option(help="robust, or paper: response and version-independent signature, then upright arrays.")
    ] = CaveConfig.rule,
    quiet: Quiet = False,
) -> None:
    """Redo the paper's SIFT/SURF CAVE: render a room of posters, read its 3-bit marker arrays, score against truth.

    Writes frame.png, overlay.png (Figure 13), response_vs_vis.png (Figure 14), polarity.png (Figure 15), report.html
    and result.json; with --frames also frames.csv, walk.mp4, the camera's poses (truth.tum, arrays.tum) and, with the
    extra view, trajectory.html: both in space.
    """
    drawn = drawn_by(renderer, samples, sensor, bake, seed)
    config = CaveConfig(scene, frames, rule=cast(CaveRule, rule), marker=cast(Made, marker), **drawn)
    console = new_console(quiet)
    with progress_bar(console, "render, detect, decode, score", frames + 1) as bar:
        result = walk_results.run_cave(config, out, bar.advance)
    print_table(console, f"{scene} · {renderer} · seed {seed}", FIGURES, walk_results.result_rows(result))
    print_path(console, out / "report.html")


@examples(
    "python scripts/evaluate_cave.py --rooms 4 --views 3",
    "python scripts/evaluate_cave.py --split training --workers 2 --out out/tuning",
)
def evaluate_cave(
    out: Out = Path("out/cave_evaluation"),
    rooms: Annotated[int, Option(help="Random rooms.")] = EvaluationConfig.rooms,
    views: RoomViews = EvaluationConfig.views,
    split: Annotated[str, Option(help="held-out, or training to tune on.")] = EvaluationConfig.split,
    size: Annotated[float, Option(help="Share of the cameras' width and height.")] = EvaluationConfig.size,
    seed: RoomsSeed = EvaluationConfig.seed,
    workers: Annotated[int, Option(help="Processes.")] = 1,
    quiet: Quiet = False,
) -> None:
    """Read random views (0.5–4 m, tilt to 45°, any roll, noise, blur) of rooms never used for tuning, and score them.

    Writes report.html and result.json, and keeps each finished room in journal.jsonl: started again with the same
    arguments, or with more rooms, it resumes where it stopped.
    """
    config = EvaluationConfig(rooms, views, cast(Split, split), size, seed)
    console = new_console(quiet)
    with resumable(), progress_bar(console, "render, read, score", rooms) as bar:
        records = evaluate(config, out, workers, bar.show)
    figures = write_evaluation(config, records, out)
    print_table(console, f"{split} rooms · seed {seed}", FIGURES_WITH_INTERVALS, headline(figures))
    print_path(console, out / "report.html")


@examples(
    "python scripts/train_classifier.py --training-rooms 16 --views 3",
    "python scripts/train_classifier.py --reuse --out out/classifier",
)
def train_classifier(
    out: Out = Path("out/classifier"),
    training_rooms: Annotated[int, Option(help="Random rooms to learn from.")] = TrainingConfig.training_rooms,
    held_out_rooms: Annotated[
        int, Option(help="Random rooms with other photographs, cameras and noise to evaluate on.")
    ] = TrainingConfig.held_out_rooms,
    views: RoomViews = TrainingConfig.views,
    layers: Annotated[int, Option(help="Layers an octave of the key points.")] = TrainingConfig.layers,
    seed: RoomsSeed = TrainingConfig.seed,
    reuse: Annotated[bool, Option("--reuse", help="Take the samples that --out holds; render nothing.")] = False,
    quiet: Quiet = False,
) -> None:
    """Train the classifiers of key points on rendered rooms and evaluate them on others (the paper's Section 5).

    Writes classifier.json (the kind that ships), roc.png, training.npz, held_out.npz, report.html and result.json.
    """
    config = TrainingConfig(training_rooms, held_out_rooms, views, seed, layers)
    console = new_console(quiet)
    with progress_bar(console, "render rooms", training_rooms + held_out_rooms) as bar:
        result = training.run_training(config, out, reuse, bar.advance)
    print_table(console, "evaluated on held-out rooms", training.HEAD, training.table_rows(result))
    print_path(console, out / "report.html")


@examples("python scripts/compare_polarity.py", "python scripts/compare_polarity.py --trials 25 --out out/polarity")
def compare_polarity(
    out: Out = Path("out/polarity"),
    trials: Annotated[int, Option(help="Images of each polarity a condition.")] = 100,
    seed: NoiseSeed = 0,
    quiet: Quiet = False,
) -> None:
    """Tell dark from light markers by the Laplacian and by the signature, under conditions in which both fail.

    Writes report.html and result.json.
    """
    check_range("trials", trials, 1)
    check_range("seed", seed, 0)
    console = new_console(quiet)
    with progress_bar(console, "render, detect, tell", sum(map(len, polarity.CONDITIONS.values()))) as bar:
        rows = polarity.compare_polarity(trials, seed, bar.advance)
    polarity.write_polarity(rows, trials, seed, out)
    table = polarity.polarity_table(rows)
    print_table(console, f"dark or light · seed {seed}", table.head, table.rows)
    print_path(console, out / "report.html")


@examples("python scripts/dense_wall.py", "python scripts/dense_wall.py --threshold 1000 --out out/dense_wall")
def dense_wall(
    out: Out = Path("out/dense_wall"),
    scene: Annotated[str, Option(help="Scene with posters called dark, light and mixed.")] = "cave",
    threshold: Annotated[float, Option(help="Hessian threshold of the features.")] = 500.0,
    seed: NoiseSeed = 0,
    quiet: Quiet = False,
) -> None:
    """Count SURF features on walls with and without dense posters, and those found again from 30° beside.

    Writes report.html and result.json.
    """
    title, table = compare_walls(scene, threshold, seed, out)
    console = new_console(quiet)
    print_table(console, title, table.head, table.rows)
    print_path(console, out / "report.html")
