"""Results for walls with and without dense posters: report.html and result.json."""

from collections.abc import Sequence
from dataclasses import astuple
from pathlib import Path

from peaksim.scene.file import load_scene

from peakmark.errors import InputError
from peakmark.experiments.cave.dense_wall import APART_DEG, DISTANCE_M, WALLS, WallFeatures, count_features
from peakmark.report.page import Section, Table, write_report
from peakmark.report.results import result_folder, write_json


def compare_walls(scene: str, threshold: float, seed: int, out: Path) -> tuple[str, Table]:
    """Measure every wall with and without its posters, write the results, and return the table with its title.

    Raises
    ------
    InputError
        If the scene or its posters are missing, the seed is negative, or `out` cannot be written.
    """
    if seed < 0:
        raise InputError(f"--seed: expected 0 or more, got {seed}")
    setup = load_scene(scene)
    rows = [count_features(setup, name, has, threshold, seed) for name in WALLS for has in (True, False)]
    table = table_of(rows)
    lead = f"SURF, threshold {threshold:g}; two views {APART_DEG:g}° apart, {DISTANCE_M:g} m away, seed {seed}."
    with result_folder(out) as folder:
        write_report(folder / "report.html", "Feature points of dense walls", lead, [Section("Walls", table=table)])
        write_json(folder / "result.json", {"threshold": threshold, "seed": seed, "rows": rows})
    return lead, table


def table_of(rows: Sequence[WallFeatures]) -> Table:
    """Return one row a wall."""
    head = ("wall", "posters", "features", "features/MP", "in both views", "found again", "share")
    return Table(head, [(row.wall, "yes" if row.posters else "no", *astuple(row)[2:]) for row in rows])
