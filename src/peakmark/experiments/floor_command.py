"""The command behind `scripts/render_floor.py`: arguments, progress, and what the terminal shows."""

from pathlib import Path
from typing import Annotated, cast

from peaksim.rendering import Renderer
from rich.console import Console
from rich.progress import Progress
from rich.table import Table
from typer import Option

from peakmark.experiments.floor import FloorConfig


def render_floor(
    scene: Annotated[str, Option(help="Scene file, or the name of a shipped scene.")] = "floor",
    out: Annotated[Path, Option(help="Folder for the results; made if missing.")] = Path("out/floor"),
    renderer: Annotated[str, Option(help="gl (pyrender), exact (planar scenes, no OpenGL) or auto.")] = "auto",
    seed: Annotated[int, Option(help="Seed of the sensor noise.")] = 0,
    texture: Annotated[str | None, Option(help="Floor photograph: gravel, brick, grass. [default: gravel]")] = None,
    stretch: Annotated[float, Option(help="Vertical stretch before detection; the paper takes 2.")] = 2.0,
    frames: Annotated[int, Option(help="Frames along the path, each scored; more than 1 also makes a film.")] = 1,
    quiet: Annotated[bool, Option("--quiet", help="Print nothing but errors.")] = False,
) -> None:
    """Redo the paper's robot experiment: render a lab floor with 14 markers, find them with SURF, score against truth.

    Writes frame.png, overlay.png (Figure 10), responses.png (Figure 11), signatures.png (Figure 12), report.html and
    result.json; with --frames also frames.csv and flight.mp4.
    """
    from peakmark.experiments.floor_results import result_rows, run
    from peakmark.report import cell

    console = Console(stderr=False, quiet=quiet)
    config = FloorConfig(scene, texture, cast(Renderer, renderer), seed, stretch, frames)
    with Progress(console=console, transient=True, disable=quiet) as progress:
        task = progress.add_task("load scene", total=frames + 1)

        def on_step() -> None:
            progress.update(task, advance=1, description="render, detect, identify, score")

        result = run(config, out, on_step)
    table = Table("figure", "value", title=f"{scene} · {result['renderer']} · seed {seed}")
    table.columns[1].justify = "right"
    for name, value in result_rows(result):
        table.add_row(name, cell(value))
    console.print(table)
    console.print(f"Results: {out / 'report.html'}", soft_wrap=True)
