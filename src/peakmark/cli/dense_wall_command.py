"""The command behind `scripts/dense_wall.py`."""

from dataclasses import astuple
from pathlib import Path
from typing import Annotated

from peaksim.scene.file import load_scene
from rich.console import Console
from typer import Option

from peakmark.cli.terminal import print_table
from peakmark.errors import InputError
from peakmark.experiments.cave.dense_wall import APART_DEG, DISTANCE_M, WALLS, count_features
from peakmark.report.page import Section, Table, write_report
from peakmark.report.results import result_folder, write_json

HEAD = ("wall", "posters", "features", "features/MP", "in both views", "found again", "share")


def dense_wall(
    out: Annotated[Path, Option(help="Folder for the results; made if missing.")] = Path("out/dense_wall"),
    scene: Annotated[str, Option(help="Scene with posters called dark, light and mixed.")] = "cave",
    threshold: Annotated[float, Option(help="Hessian threshold of the features.")] = 500.0,
    seed: Annotated[int, Option(help="Seed of the sensor noise.")] = 0,
    quiet: Annotated[bool, Option("--quiet", help="Print nothing but errors.")] = False,
) -> None:
    """Count SURF features on walls with and without dense posters, and those found again from 30° beside.

    Writes report.html and result.json.
    """
    if seed < 0:
        raise InputError(f"--seed: expected 0 or more, got {seed}")
    setup = load_scene(scene)
    rows = [count_features(setup, name, has, threshold, seed) for name in WALLS for has in (True, False)]
    cells = [(row.wall, "yes" if row.posters else "no", *astuple(row)[2:]) for row in rows]
    lead = f"SURF, threshold {threshold:g}; two views {APART_DEG:g}° apart, {DISTANCE_M:g} m away, seed {seed}."
    sections = [Section("Walls", table=Table(HEAD, cells))]
    with result_folder(out) as folder:
        write_report(folder / "report.html", "Feature points of dense walls", lead, sections)
        write_json(folder / "result.json", {"threshold": threshold, "seed": seed, "rows": rows})
    print_table(Console(quiet=quiet), lead, HEAD, cells)
    Console(quiet=quiet).print(f"Results: {out / 'report.html'}", soft_wrap=True)
