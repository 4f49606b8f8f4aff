"""`peakmark envelope`: how near, how far and how oblique a printed marker is found by a given camera."""

import re
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

from peaksim.scene.build_camera import build_camera
from peaksim.scene.file import read_table
from rich.table import Table
from typer import Option

from peakmark.cli.command import examples
from peakmark.cli.options import Quiet, UnusedSeed
from peakmark.cli.terminal import new_console, print_path
from peakmark.errors import InputError
from peakmark.experiments.detectability.envelope import REQUIRED, Rates, Reach, distance_m, load_rates, reach, sentence
from peakmark.report import plots
from peakmark.report.results import result_folder, write_json

SIDES_M = (0.001, 5.0)
"""Sides of printed markers: others are lengths in another unit (the largest standard paper, 2A0, is 1.7 m long)."""

_OBLIQUE_DEG = 60
_SIZE_AND_FOCAL = re.compile(r"(\d+)[x×](\d+)@(\d+(?:\.\d+)?)")


@examples(
    "peakmark envelope --camera 2048x1536@1774 --side-m 0.08",
    "peakmark envelope --camera scenes/floor.toml --marker sift-dark --detector sift",
)
def envelope(
    camera: Annotated[str, Option(help="Scene file or name whose camera to take, or WIDTHxHEIGHT@FOCAL_PX.")] = "floor",
    side_m: Annotated[float, Option(help="Printed side of the marker without border, metres.")] = 0.08,
    marker: Annotated[
        str, Option(help="surf-dark, sift-dark, or sift-range-dark, the disc; light ones are found as dark ones are.")
    ] = "surf-dark",
    detector: Annotated[str, Option(help="surf, surf-paper or sift.")] = "surf",
    noise: Annotated[float, Option(help="σ of the noise, grey levels: 0 or 10.")] = 0.0,
    required: Annotated[float, Option(help="Detection rate that the lower end of its interval must reach.")] = REQUIRED,
    rates: Annotated[Path | None, Option(help="envelope.csv of a run of yours. [default: the shipped one]")] = None,
    out: Annotated[Path, Option(help="Folder for the map and result.json.")] = Path("out/envelope"),
    seed: UnusedSeed = 0,
    quiet: Quiet = False,
) -> None:
    """Say at which distances and tilts a camera finds a marker of a printed size, from measured detection rates."""
    focal_px = focal_length_px(camera)
    if not SIDES_M[0] <= side_m <= SIDES_M[1]:
        expected = f"the printed side in metres, {SIDES_M[0]:g}…{SIDES_M[1]:g}"
        raise InputError(f"--side-m: expected {expected}, got {side_m:g}; is it in mm or cm?")
    measured = load_rates(marker, detector, noise, rates)
    reaches = reach(measured, focal_px, side_m, required)
    title = f"{marker}, {100 * side_m:g} cm, by {detector}; camera {camera}, noise σ {noise:g}"
    with result_folder(out) as folder:
        _write_map(folder, title, measured, focal_px, side_m, required)
        settings = {"camera": camera, "focal_px": focal_px, "side_m": side_m, "marker": marker}
        settings |= {"detector": detector, "noise": noise, "required": required}
        write_json(folder / "result.json", {"settings": settings, "reach": [asdict(one) for one in reaches]})
    if not quiet:
        _print(title, side_m, reaches, out)


def focal_length_px(camera: str) -> float:
    """Return the focal length of "WIDTHxHEIGHT@FOCAL_PX" or of a scene's camera (the mean of its two).

    Raises
    ------
    InputError
        If it is neither.
    """
    if match := _SIZE_AND_FOCAL.fullmatch(camera):
        return float(match[3])
    if "@" in camera or re.fullmatch(r"[\d.]+[x×][\d.]+", camera):
        raise InputError(f"--camera: expected a scene or WIDTHxHEIGHT@FOCAL_PX such as 2048x1536@1774, got {camera!r}")
    built = build_camera(read_table(camera)[0].camera)
    return (built.fx + built.fy) / 2


def _write_map(folder: Path, title: str, measured: Rates, focal_px: float, side_m: float, required: float) -> None:
    figure, ax = plots.new_figure()
    distances = distance_m(measured.side_px, focal_px, side_m)
    plots.envelope_map(ax, distances, measured.tilt_deg, measured.detected, measured.detected_low >= required)
    ax.set(title=title)
    for ending in ("png", "svg"):
        plots.save(figure, folder / f"envelope.{ending}")


def _print(title: str, side_m: float, reaches: list[Reach], out: Path) -> None:
    table = Table(title=title, min_width=len(title))
    for head in ("tilt", "nearest", "farthest", "misses between"):
        table.add_column(head, justify="right")
    for one in reaches:
        gaps = ", ".join(f"{near:.2f}–{far:.2f} m" for near, far in one.gaps_m)
        table.add_row(f"{one.tilt_deg:g}°", _metres(one.nearest_m), _metres(one.farthest_m), gaps)
    console = new_console()
    console.print(table)
    oblique = [one for one in reaches if one.tilt_deg <= _OBLIQUE_DEG][-1:]
    for one in oblique:
        console.print(sentence(side_m, one), soft_wrap=True)
    print_path(console, out / "envelope.png")


def _metres(value: Any) -> str:
    return "–" if value is None else f"{value:.2f} m"
