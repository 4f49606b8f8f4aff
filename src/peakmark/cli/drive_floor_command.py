"""The command behind `scripts/drive_floor.py`: arguments, progress, and what the terminal shows."""

from pathlib import Path
from typing import Annotated, cast

from peaksim.rendering import Renderer
from rich.console import Console
from rich.progress import Progress
from typer import Option

from peakmark.cli.terminal import print_table
from peakmark.experiments.robot.drive import DriveConfig
from peakmark.experiments.robot.drive_results import result_rows, run


def drive_floor(
    paths: Annotated[int, Option(help="Random paths, each driven once.")] = 20,
    length: Annotated[float, Option(help="Length of each, m.")] = 10.0,
    spacing: Annotated[float, Option(help="From marker to marker, m.")] = 0.3,
    line_ends: Annotated[
        float | None,
        Option(help="Where the markers stop short, m: the robot must stop there. [default: beyond the end]"),
    ] = None,
    rate: Annotated[float, Option(help="Pictures that the robot takes a second.")] = 5.0,
    scene: Annotated[str, Option(help="Scene whose floor, sensor and kind of marker are used.")] = "hall",
    texture: Annotated[str | None, Option(help="Floor photograph. [default: the scene's first]")] = None,
    renderer: Annotated[str, Option(help="gl, exact, traced (Mitsuba) or auto.")] = "auto",
    samples: Annotated[int, Option(help="Paths a pixel of the traced renderer.")] = DriveConfig.samples,
    out: Annotated[Path, Option(help="Folder for the results; made if missing.")] = Path("out/drive"),
    seed: Annotated[int, Option(help="Seed of paths, wheels and sensor.")] = 0,
    resume: Annotated[bool, Option("--resume", help="Keep the finished paths of an interrupted run.")] = False,
    quiet: Annotated[bool, Option("--quiet", help="Print nothing but errors.")] = False,
) -> None:
    """Let a robot drive along random lines of floor markers by nothing but what its camera sees of them.

    Differential drive with wheel noise and latency; every frame is rendered, markers are found in it with SURF, and
    the wheels follow. Writes paths.csv, top_view.png, drive.mp4 (the first path), report.html and result.json.
    """
    console = Console(quiet=quiet)
    config = DriveConfig(
        paths,
        length,
        spacing,
        line_ends,
        scene,
        texture,
        cast(Renderer, renderer),
        seed,
        frames_per_second=rate,
        samples=samples,
    )
    with Progress(console=console, transient=True, disable=quiet) as progress:
        task = progress.add_task("drive", total=paths)
        result = run(config, out, resume, lambda done: progress.update(task, completed=done))
    title = f"{scene} · {result['renderer']} · seed {seed}"
    print_table(console, title, ("figure", "value", "low", "high", "of"), result_rows(result))
    console.print(f"Results: {out / 'report.html'}", soft_wrap=True)
