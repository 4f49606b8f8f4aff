"""The camera's poses along a walk through the CAVE: TUM files, and a page on which they are rotated in space."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from peakmark.experiments.cave.walk import CaveView
from peakmark.localise.from_arrays import Place
from peakmark.report.trajectory_file import write_known_poses
from peakmark.report.trajectory_view import Line, has_trajectory_view, positions_of, write_trajectory_view

PAGE = "trajectory.html"
"""Written where Plotly is installed."""

LEAD = "Drag to rotate, scroll to zoom, click names to hide. Grey: the markers of the arrays that were read."


@dataclass(frozen=True)
class WalkStep:
    """Where the camera was in a frame, and where the arrays put it."""

    time_s: float
    """On the path."""
    truth: NDArray[np.float64]
    """(4, 4) world_from_camera."""
    found: NDArray[np.float64] | None
    """(4, 4) from the arrays; None without any."""
    error: tuple[float, float] | None
    """Between them, mm and degrees."""
    codes: tuple[int, ...]
    """That were read, rightly or wrongly."""


def step_of(view: CaveView) -> WalkStep:
    """Return a frame's poses; the image is not kept."""
    pose = view.reading.pose
    codes = tuple(array.code for array in view.reading.arrays if array.code is not None)
    found = None if pose is None else pose.fit.world_from_camera
    return WalkStep(view.frame.time_s, view.frame.world_from_camera, found, view.pose_error, codes)


def write_walk_poses(folder: Path, steps: Sequence[WalkStep], places: Mapping[int, Place]) -> list[str]:
    """Write truth.tum, arrays.tum where any pose was found, and then the page; return the names of what is there."""
    times_s, truth, found = [s.time_s for s in steps], [s.truth for s in steps], [s.found for s in steps]
    write_known_poses(folder / "truth.tum", times_s, truth)
    write_known_poses(folder / "arrays.tum", times_s, found)
    if has_trajectory_view() and any(pose is not None for pose in found):
        names = [f"frame {k}, {step.time_s:.2f} s" for k, step in enumerate(steps)]
        offs = [name + _off(step.error) for name, step in zip(names, steps, strict=True)]
        lines = [Line("truth", positions_of(truth), names), Line("from arrays", positions_of(found), offs)]
        seen_m = _centers_m((code for step in steps for code in step.codes), places)
        write_trajectory_view(folder / PAGE, "The camera's trajectory", LEAD, lines, seen_m)
    return [name for name in ("truth.tum", "arrays.tum", PAGE) if (folder / name).exists()]


def _off(error: tuple[float, float] | None) -> str:
    return "" if error is None else f"<br>{error[0]:.2f} mm, {error[1]:.3f}° off"


def _centers_m(codes: Iterable[int], places: Mapping[int, Place]) -> NDArray[np.float64]:
    """Return the (m, 3) markers of the arrays with these codes, as far as they are on the map."""
    known = sorted(set(codes) & set(places))
    return np.concatenate([np.zeros((0, 3)), *(places[code].centers_m for code in known)])
