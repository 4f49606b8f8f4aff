"""The command behind `scripts/render_floor.py`: arguments, progress, and what the terminal shows."""

from pathlib import Path
from typing import Annotated, cast

from peaksim.rendering import Renderer
from rich.console import Console
from rich.progress import Progress
from typer import Option

from peakmark.cli.terminal import print_table
from peakmark.experiments.floor import flight_report, flight_results, still_results
from peakmark.experiments.floor.flight import FlightConfig
from peakmark.experiments.floor.still import FloorConfig
from peakmark.identification.api import Rule


def render_floor(
    scene: Annotated[str | None, Option(help="Scene file, or the name of a shipped scene. [default: floor]")] = None,
    out: Annotated[Path, Option(help="Folder for the results; made if missing.")] = Path("out/floor"),
    renderer: Annotated[str, Option(help="gl (pyrender), exact (no OpenGL), traced (Mitsuba) or auto.")] = "auto",
    samples: Annotated[int, Option(help="Paths a pixel of the traced renderer.")] = FloorConfig.samples,
    seed: Annotated[int, Option(help="Seed of the sensor noise.")] = 0,
    texture: Annotated[
        str | None, Option(help="Floor photograph: gravel, brick, grass; in the hall also coins. [default: gravel]")
    ] = None,
    stretch: Annotated[
        float | None,
        Option(help="Vertical stretch before detection. [default: the paper's 2; on a ride what its pitch implies]"),
    ] = None,
    frames: Annotated[
        int | None,
        Option(help="Frames along the path, each scored; more than 1 also makes a film. [default: 1; a ride: all]"),
    ] = None,
    rule: Annotated[
        str | None, Option(help="paper (rank and response drop) or joint. [default: paper; on a ride joint]")
    ] = None,
    trajectory: Annotated[
        str | None,
        Option(help="Fly through: a ride (stroll, bumpy, sharp or a TOML file), or TUM, EuRoC or KITTI poses."),
    ] = None,
    map: Annotated[
        str | None, Option(help="Scene whose markers are the map of --trajectory. [default: the one flown through]")
    ] = None,
    resume: Annotated[
        bool, Option("--resume", help="Keep the finished frames of an interrupted --trajectory.")
    ] = False,
    quiet: Annotated[bool, Option("--quiet", help="Print nothing but errors.")] = False,
) -> None:
    """Redo the paper's robot experiment: render a lab floor with 14 markers, find them with SURF, score against truth.

    Writes frame.png, overlay.png (Figure 10), responses.png (Figure 11), signatures.png (Figure 12), report.html and
    result.json; with --frames also frames.csv and flight.mp4. With --trajectory it flies through instead, and writes
    frames.csv, detections.parquet, flight.mp4, top_view.png, the poses as TUM files, report.html and result.json.
    """
    console = Console(stderr=False, quiet=quiet)
    if trajectory is not None:
        drawn_by, decided_by = cast(Renderer, renderer), cast(Rule, rule or "joint")
        flight = FlightConfig(trajectory, scene, texture, drawn_by, seed, stretch, decided_by, frames, map, samples)
        _fly(console, flight, out, resume)
    else:
        still = FloorConfig(
            scene or "floor",
            texture,
            cast(Renderer, renderer),
            seed,
            2.0 if stretch is None else stretch,
            1 if frames is None else frames,
            cast(Rule, rule or "paper"),
            samples,
        )
        _render(console, still, out)
    console.print(f"Results: {out / 'report.html'}", soft_wrap=True)


def _render(console: Console, config: FloorConfig, out: Path) -> None:
    with Progress(console=console, transient=True, disable=console.quiet) as progress:
        task = progress.add_task("load scene", total=config.frames + 1)

        def on_step() -> None:
            progress.update(task, advance=1, description="render, detect, identify, score")

        result = still_results.run(config, out, on_step)
    title = f"{config.scene} · {result['renderer']} · seed {config.seed}"
    print_table(console, title, ("figure", "value"), still_results.result_rows(result))


def _fly(console: Console, config: FlightConfig, out: Path, is_resumed: bool) -> None:
    with Progress(console=console, transient=True, disable=console.quiet) as progress:
        task = progress.add_task("load scene", total=None)

        def on_step(total: int) -> None:
            progress.update(task, advance=1, total=total + 1, description="render, detect, identify, score")

        result = flight_results.run(config, out, is_resumed, on_step)
    for remark in result["remarks"]:
        console.print(f"note: {remark}")
    title = f"{config.trajectory} · {result['renderer']} · seed {config.seed}"
    print_table(console, title, ("figure", "value", "low", "high", "of"), flight_report.result_rows(result))
