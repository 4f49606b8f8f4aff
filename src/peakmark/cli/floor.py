"""The commands behind the scripts of the floor and of the robot: arguments, progress, and what the terminal shows."""

from pathlib import Path
from typing import Annotated, cast

from rich.console import Console
from typer import Argument, Option

from peakmark.cli.command import examples, resumable
from peakmark.cli.options import Bake, NoiseSeed, Out, Quiet, Samples, SensorName, drawn_by
from peakmark.cli.terminal import FIGURES, FIGURES_WITH_INTERVALS, new_console, print_path, print_table, progress_bar
from peakmark.errors import InputError
from peakmark.experiments.floor import flight_report, flight_results, flights_results, still
from peakmark.experiments.floor.flight import FlightConfig
from peakmark.experiments.floor.flights import FLIGHTS
from peakmark.experiments.floor.still import FloorConfig
from peakmark.experiments.robot import drive_results
from peakmark.experiments.robot.drive import DriveConfig
from peakmark.identification.api import Narrower
from peakmark.markers.patterns import Made

_WITH_RESUME = "the same command with --resume resumes"
_STAGES = "render, detect, identify, score"


@examples("peakmark floor --out out/floor", "peakmark floor --texture brick --frames 60 --out out/film")
def render_floor(
    scene: Annotated[str | None, Option(help="Scene file, or the name of a shipped scene. [default: floor]")] = None,
    out: Out = Path("out/floor"),
    renderer: Annotated[str, Option(help="gl, exact (no OpenGL), pyrender, traced (Mitsuba) or auto.")] = "auto",
    samples: Samples = FloorConfig.samples,
    sensor: SensorName = None,
    bake: Bake = True,
    seed: NoiseSeed = 0,
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
    marker: Annotated[
        str, Option(help="surf, or sift: SIFT's markers on the floor, found by OpenCV's SIFT.")
    ] = FloorConfig.marker,
    preset: Annotated[
        str, Option(help="SURF's: opencv (4 octaves of 3 layers) or paper (4 of 2).")
    ] = FloorConfig.preset,
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
    quiet: Quiet = False,
) -> None:
    """Redo the paper's robot experiment: a lab floor with 14 markers, found with SURF, scored against truth.

    Writes frame.png, overlay.png (Figure 10), responses.png (Figure 11), signatures.png (Figure 12), report.html and
    result.json; with --frames also frames.csv and flight.mp4, with --preset paper the ranks on stretched.png. With
    --trajectory it flies through instead, and writes frames.csv, detections.parquet, flight.mp4, top_view.png, the
    poses as TUM files, report.html and result.json.
    """
    console = new_console(quiet)
    drawn = drawn_by(renderer, samples, sensor, bake, seed)
    decided_by = cast(Narrower, rule or ("paper" if trajectory is None else "joint"))
    if trajectory is not None:
        _check_usual(preset, marker)
        flight = FlightConfig(trajectory, scene, texture, stretch, decided_by, frames, map, **drawn)
        _fly(console, flight, out, resume)
    else:
        factor, count = 2.0 if stretch is None else stretch, 1 if frames is None else frames
        by = (decided_by, cast(still.Preset, preset), cast(Made, marker))
        _render(console, FloorConfig(scene or "floor", texture, factor, count, *by, **drawn), out)
    print_path(console, out / "report.html")


def _check_usual(preset: str, marker: str) -> None:
    """Refuse what a flight does not have."""
    for name, value, usual in (("preset", preset, FloorConfig.preset), ("marker", marker, FloorConfig.marker)):
        if value != usual:
            raise InputError(f"--{name}: expected {usual} with --trajectory, got {value}")


def _render(console: Console, config: FloorConfig, out: Path) -> None:
    with progress_bar(console, _STAGES, config.frames + 1) as bar:
        result = still.run_floor(config, out, lambda done, of: bar.show(done + 1, of + 1))
    for remark in result.remarks:
        console.print(f"note: {remark}", soft_wrap=True)
    title = f"{config.scene} · {result.renderer} · seed {config.seed}"
    print_table(console, title, FIGURES, still.result_rows(result))


def _fly(
    console: Console,
    config: FlightConfig,
    out: Path,
    is_resumed: bool,
    record: Path | None = None,
    overlays: bool = False,
) -> None:
    with resumable(_WITH_RESUME), progress_bar(console, _STAGES) as bar:
        result = flight_results.run_flight(
            config, out, is_resumed, lambda done, of: bar.show(done + 1, of + 1), record, overlays
        )
    for remark in result.remarks:
        console.print(f"note: {remark}", soft_wrap=True)
    title = f"{config.trajectory} · {result.renderer} · seed {config.seed}"
    print_table(console, title, FIGURES_WITH_INTERVALS, flight_report.result_rows(result))


@examples("peakmark fly stroll --out out/flight", "peakmark fly poses.tum --scene hall --frames 20 --resume")
def fly(
    trajectory: Annotated[
        str, Argument(help="A ride (stroll, bumpy, sharp or a TOML file), or TUM, EuRoC or KITTI poses.")
    ] = "stroll",
    scene: Annotated[str | None, Option(help="Scene to fly through. [default: the ride's own]")] = None,
    out: Out = Path("out/flight"),
    renderer: Annotated[str, Option(help="gl, exact (no OpenGL), pyrender, traced (Mitsuba) or auto.")] = "auto",
    samples: Samples = FlightConfig.samples,
    sensor: SensorName = None,
    bake: Bake = True,
    seed: NoiseSeed = 0,
    texture: Annotated[str | None, Option(help="Floor photograph. [default: the scene's first]")] = None,
    stretch: Annotated[
        float | None, Option(help="Vertical stretch before detection. [default: what the ride's pitch implies]")
    ] = None,
    frames: Annotated[int | None, Option(help="Only so many frames, from the start. [default: all]")] = None,
    map: Annotated[str | None, Option(help="Scene whose markers are the map. [default: the one flown through]")] = None,
    record: Annotated[
        Path | None, Option(help="Recording too: .mcap (Foxglove, ROS 2) or .rrd (Rerun), truth beside estimate.")
    ] = None,
    overlays: Annotated[bool, Option("--overlays", help="Keep the drawing of each frame, in OUT/frames.")] = False,
    resume: Annotated[bool, Option("--resume", help="Keep the finished frames of an interrupted flight.")] = False,
    quiet: Quiet = False,
) -> None:
    """Fly a camera over a floor of markers: find them, and locate the camera by them.

    Writes frames.csv, detections.parquet, flight.mp4, top_view.png, the poses as TUM files, report.html and
    result.json; with the extra view also trajectory.html, the trajectories in space. With --overlays each figure links
    to the frames behind it.
    """
    console = new_console(quiet)
    drawn = drawn_by(renderer, samples, sensor, bake, seed)
    config = FlightConfig(trajectory, scene, texture, stretch, "joint", frames, map, **drawn)
    _fly(console, config, out, resume, record, overlays)
    print_path(console, out / "report.html")


@examples(
    "python scripts/evaluate_flights.py --first 2 --frames 20",
    "python scripts/evaluate_flights.py --resume --out out/flights",
)
def evaluate_flights(
    out: Annotated[Path, Option(help="Folder for the results; each flight gets a folder in it.")] = Path("out/flights"),
    frames: Annotated[int | None, Option(help="Frames of each flight, from its start. [default: all]")] = None,
    first: Annotated[int, Option(help="Only so many of the ten flights.")] = len(FLIGHTS),
    seed: Annotated[int, Option(help="Added to the seed of each flight.")] = 0,
    resume: Annotated[bool, Option("--resume", help="Keep what an interrupted run finished.")] = False,
    quiet: Quiet = False,
) -> None:
    """Measure finding markers over ten flights on floors never tuned for, and on images without any marker.

    Recall, precision, distance and poses by side, tilt and distance, with intervals; the same frames under several
    stretches. Writes report.html, result.json and the results of each flight.
    """
    if not 1 <= first <= len(FLIGHTS) or seed < 0:
        raise InputError(f"expected --first 1…{len(FLIGHTS)} and --seed 0 or more, got {first} and {seed}")
    console = new_console(quiet)
    chosen = [(ride, floor, own + seed) for ride, floor, own in FLIGHTS[:first]]
    with resumable(_WITH_RESUME):
        result = flights_results.run_flights(out, frames, resume, chosen, console.print)
    print_table(console, f"{first} flights", FIGURES_WITH_INTERVALS, flights_results.headline(result))
    print_path(console, out / "report.html")


@examples("peakmark drive --paths 3 --out out/drive", "peakmark drive --paths 20 --line-ends 2 --resume")
def drive_floor(
    paths: Annotated[int, Option(help="Random paths, each driven once.")] = 20,
    length: Annotated[float, Option(help="Length of each, m.")] = 10.0,
    spacing: Annotated[float, Option(help="From marker to marker, m.")] = 0.3,
    line_ends: Annotated[
        float | None,
        Option(help="Where the markers stop short, m: the robot must stop there. [default: beyond the end]"),
    ] = None,
    rate: Annotated[float, Option(help="Images that the robot takes a second.")] = 5.0,
    scene: Annotated[str, Option(help="Scene whose floor, sensor and kind of marker are used.")] = "hall",
    texture: Annotated[str | None, Option(help="Floor photograph. [default: the scene's first]")] = None,
    renderer: Annotated[str, Option(help="gl, exact, pyrender, traced (Mitsuba) or auto.")] = "auto",
    samples: Samples = DriveConfig.samples,
    sensor: SensorName = None,
    bake: Bake = True,
    out: Out = Path("out/drive"),
    seed: Annotated[int, Option(help="Seed of paths, wheels and sensor.")] = 0,
    resume: Annotated[bool, Option("--resume", help="Keep the finished paths of an interrupted run.")] = False,
    quiet: Quiet = False,
) -> None:
    """Let a robot drive along random lines of floor markers by nothing but what its camera sees of them.

    Differential drive with wheel noise and latency; every frame is rendered, markers are found in it with SURF, and
    the wheels follow. Writes paths.csv, top_view.png, drive.mp4 (the first path), report.html and result.json.
    """
    console = new_console(quiet)
    drawn = drawn_by(renderer, samples, sensor, bake, seed)
    config = DriveConfig(paths, length, spacing, line_ends, scene, texture, frames_per_second=rate, **drawn)
    with resumable(_WITH_RESUME), progress_bar(console, "drive", paths) as bar:
        result = drive_results.run_drives(config, out, resume, bar.show)
    title = f"{scene} · {result.renderer} · seed {seed}"
    print_table(console, title, FIGURES_WITH_INTERVALS, drive_results.result_rows(result))
    print_path(console, out / "report.html")
