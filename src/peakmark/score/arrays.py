"""Arrays against truth: which are printed in a scene, which are in view, and which were read correctly."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from peaksim.camera.camera import Camera
from peaksim.camera.frame import MarkerTruth
from peaksim.geometry.pose import Pose, invert, transform
from peaksim.scene.scene import Mark, Quad, Scene

from peakmark.arrays.decode import MarkerArray
from peakmark.localise.from_arrays import Place
from peakmark.markers.array_code import THREE_BIT, Layout, code_of
from peakmark.score.wanted import READABLE, polarity_of

_GRID_TOLERANCE = 0.05
"""Deviation of a mark from its cell, in cells, up to which marks form an array: only the rounding of scene files."""


@dataclass(frozen=True)
class PrintedArray:
    """An array of a scene, and where it is."""

    name: str
    """Of the quad that carries it."""
    code: int
    marks: tuple[str, ...]
    """Names of its marks in reading order."""
    place: Place
    """Where they are."""
    corners_m: NDArray[np.float64]
    """(4, 3) world corners of the square around it, the blank corner first, then clockwise."""


def printed_arrays(scene: Scene, layout: Layout = THREE_BIT) -> tuple[PrintedArray, ...]:
    """Return the arrays of a scene: quads whose marks are a layout and nothing else."""
    found = (_printed(quad, layout) for quad in scene.quads)
    return tuple(array for array in found if array is not None)


def _printed(quad: Quad, layout: Layout) -> PrintedArray | None:
    marks = sorted(quad.marks, key=lambda m: (-round(m.center_m[1] / m.side_m, 1), m.center_m[0]))
    if len(marks) != len(layout.cells) or not _on_grid(marks, layout):
        return None
    code = code_of([polarity_of(mark.kind) for mark in marks], layout)
    if code is None:
        return None
    side, pitch = marks[0].side_m, marks[0].side_m * layout.pitch
    centers = np.array([[*mark.center_m, 0.0] for mark in marks])
    left, top = centers[0, 0] - pitch - side / 2, centers[0, 1] + side / 2
    right, bottom = left + (layout.columns - 1) * pitch + side, top - (layout.rows - 1) * pitch - side
    corners = np.array([[left, top, 0], [right, top, 0], [right, bottom, 0], [left, bottom, 0]])
    return PrintedArray(
        name=quad.name,
        code=code,
        marks=tuple(mark.name for mark in marks),
        place=Place(transform(quad.world_from_quad, centers), quad.world_from_quad[:3, :2] * [1, -1], side),
        corners_m=transform(quad.world_from_quad, corners),
    )


def _on_grid(marks: Sequence[Mark], layout: Layout) -> bool:
    if len({mark.side_m for mark in marks}) != 1:
        return False
    steps = np.array([mark.center_m for mark in marks]) / (marks[0].side_m * layout.pitch) * [1, -1]
    cells = np.array(layout.cells, dtype=np.float64)
    return bool(np.abs(steps - steps[0] - (cells - cells[0])).max() <= _GRID_TOLERANCE)


@dataclass(frozen=True)
class ArrayScore:
    """One image's result."""

    in_view: tuple[str, ...]
    """Names of the arrays that must be read: every marker is `READABLE`, and the blank corner is in the image too."""
    decoded: tuple[str, ...]
    missed: tuple[str, ...]
    """Those of them that were read correctly, and those that were not."""
    wrong: int
    """Codes that were named where no array with that code lies."""
    right: dict[str, int]
    """Array → index of its reading, arrays that need not be read included."""
    unsure: int
    """Readings without a code."""


def score_arrays(
    printed: Sequence[PrintedArray],
    truth: Sequence[MarkerTruth],
    arrays: Sequence[MarkerArray],
    camera: Camera,
    world_from_camera: Pose,
    tolerance: float = 0.25,
) -> ArrayScore:
    """Score one image's readings; a marker of a reading is correct within `tolerance` sides of the true centre."""
    records = {t.name: t for t in truth}
    right: dict[str, int] = {}
    for index, array in enumerate(arrays):
        for candidate in printed:
            if candidate.code == array.code and _covers(array, [records[name] for name in candidate.marks], tolerance):
                right[candidate.name] = index
    in_view = [p.name for p in printed if is_in_view(p, records, camera, world_from_camera)]
    named = sum(array.code is not None for array in arrays)
    return ArrayScore(
        in_view=tuple(in_view),
        decoded=tuple(name for name in in_view if name in right),
        missed=tuple(name for name in in_view if name not in right),
        wrong=named - len(right),
        right=right,
        unsure=len(arrays) - named,
    )


def _covers(array: MarkerArray, marks: Sequence[MarkerTruth], tolerance: float) -> bool:
    gaps = [np.linalg.norm(d.xy - t.center_xy) / t.side_px for d, t in zip(array.detections, marks, strict=True)]
    return bool(max(gaps) <= tolerance)


def is_in_view(printed: PrintedArray, records: dict[str, MarkerTruth], camera: Camera, world_from_camera: Pose) -> bool:
    """Return whether an array must be read; see `ArrayScore.in_view`."""
    marks = [records[name] for name in printed.marks]
    if len(READABLE.of(marks)) < len(marks):
        return False
    corners = camera.project(transform(invert(world_from_camera), printed.corners_m))
    with np.errstate(invalid="ignore"):
        inside = (corners >= -0.5) & (corners <= np.array([camera.width, camera.height]) - 0.5)
    return bool(inside.all())
