"""The command behind `scripts/render_cave.py`: arguments, progress, and what the terminal shows."""

from pathlib import Path
from typing import Annotated, cast

from peaksim.rendering import Renderer
from rich.console import Console
from rich.progress import Progress
from typer import Option

from peakmark.cli.terminal import print_table
from peakmark.experiments.cave.walk import CaveConfig
from peakmark.experiments.cave.walk_results import result_rows, run


def render_cave(
    scene: Annotated[str, Option(help="Scene file, or the name of a shipped scene.")] = CaveConfig.scene,
    out: Annotated[Path, Option(help="Folder for the results; made if missing.")] = Path("out/cave"),
    renderer: Annotated[str, Option(help="exact (no OpenGL), gl, traced (Mitsuba) or auto.")] = CaveConfig.renderer,
    samples: Annotated[int, Option(help="Paths a pixel of the traced renderer.")] = CaveConfig.samples,
    seed: Annotated[int, Option(help="Seed of the sensor noise.")] = CaveConfig.seed,
    frames: Annotated[
        int, Option(help="Frames of a walk through the room, each scored; more than 1 also makes a film.")
    ] = CaveConfig.frames,
    quiet: Annotated[bool, Option("--quiet", help="Print nothing but errors.")] = False,
) -> None:
    """Redo the paper's SIFT/SURF CAVE: render a room of posters, read its 3-bit marker arrays, score against truth.

    Writes frame.png, overlay.png (Figure 13), response_vs_vis.png (Figure 14), polarity.png (Figure 15), report.html
    and result.json; with --frames also frames.csv and walk.mp4.
    """
    config = CaveConfig(scene, cast(Renderer, renderer), seed, frames, samples)
    console = Console(quiet=quiet)
    with Progress(console=console, transient=True, disable=quiet) as progress:
        task = progress.add_task("render, detect, decode, score", total=frames + 1)
        result = run(config, out, lambda: progress.update(task, advance=1))
    print_table(console, f"{scene} · {renderer} · seed {seed}", ("figure", "value"), result_rows(result))
    console.print(f"Results: {out / 'report.html'}", soft_wrap=True)
