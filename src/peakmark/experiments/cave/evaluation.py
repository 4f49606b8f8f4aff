"""How well arrays are read: random views of random rooms that had no part in any tuning, scored one by one."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Literal, get_args

import numpy as np
from peaksim.geometry.pose import Pose

from peakmark.arrays.decode import MarkerArray
from peakmark.experiments.cave.rooms import Split
from peakmark.experiments.cave.samples import room_and_frames
from peakmark.experiments.cave.walk import CaveFrame, CaveView, array_map, score_view
from peakmark.experiments.journal import Journal
from peakmark.experiments.option import check_choice, check_range
from peakmark.experiments.run import OnStep, run_items
from peakmark.localise.from_arrays import Place, pose_from_arrays
from peakmark.localise.pose import PoseEstimate
from peakmark.plain import from_plain
from peakmark.score.arrays import PrintedArray, printed_arrays
from peakmark.score.markers import MarkerScore
from peakmark.score.poses import pose_error
from peakmark.score.wanted import STEEPEST_DEG

SEVERAL, WALL = 3, 5
"""Fewest arrays for a pose from several, and from a whole wall."""

PoseKind = Literal["one", "several", "wall"]


@dataclass(frozen=True)
class EvaluationConfig:
    """What to evaluate on."""

    rooms: int = 55
    """Random rooms."""
    views: int = 10
    """Random cameras a room; a few find no free position."""
    split: Split = "held-out"
    """"held-out" or "training"."""
    size: float = 0.5
    """Share of the cameras' width and height that the images have: at 1 a view takes four times as long."""
    seed: int = 1
    """Of rooms, views and noise; the classifier's samples come from others."""

    def __post_init__(self) -> None:
        check_range("rooms", self.rooms, 1, 100_000)
        check_range("views", self.views, 1, 1000)
        check_range("size", self.size, 0.1, 1)
        check_range("seed", self.seed, 0)
        check_choice("split", self.split, get_args(Split))


@dataclass(frozen=True)
class ArrayRecord:
    """An array that must be read."""

    name: str
    """Of the quad that carries it."""
    side_px: float
    tilt_deg: float
    """Of its smallest marker, and of its most tilted one."""
    is_decoded: bool
    is_decoded_by_paper: bool
    """Whether it was read rightly, by the robust decoder and by the paper's rule."""


@dataclass(frozen=True)
class PoseRecord:
    """A camera pose from some of a view's arrays, against truth."""

    kind: PoseKind
    """From one array, from all of a view if they are several, or from those of one wall."""
    arrays: int
    """How many arrays it rests on."""
    mm: float
    deg: float
    """Distance from the true position, and angle to the true rotation."""
    is_flipped: bool
    """Whether the other pose that was found is nearer to the true rotation."""
    is_certain: bool
    """Whether no other pose explains the image nearly as well."""


@dataclass(frozen=True)
class ViewRecord:
    """What is kept of a view."""

    room: int
    camera: str
    """Its size, such as "1024×768"."""
    frame: CaveFrame
    markers: tuple[MarkerScore, ...]
    """All visible markers."""
    arrays: tuple[ArrayRecord, ...]
    """The arrays that must be read."""
    poses: tuple[PoseRecord, ...]
    """From each array alone, from several, from walls."""


def evaluate(
    config: EvaluationConfig, out: Path, workers: int = 1, on_room: OnStep = lambda done, of: None
) -> list[ViewRecord]:
    """Return the records of all views; rooms that the journal in `out` already holds are not rendered again.

    More rooms than last time extend the run; another configuration is an `InputError`.
    """
    journal = Journal.open(out, {name: value for name, value in asdict(config).items() if name != "rooms"})
    names = [f"room{room:05d}" for room in range(config.rooms)]
    rooms = run_items(journal, names, partial(room_records, config), workers, on_room)
    return [from_plain(ViewRecord, record) for records in rooms for record in records]


def room_records(config: EvaluationConfig, room: int) -> list[ViewRecord]:
    """Return the records of one room's views."""
    scene, frames = room_and_frames(config.split, room, config.views, config.seed, STEEPEST_DEG, config.size)
    printed = printed_arrays(scene.scene)
    views = (score_view(index, frame, scene.scene) for index, frame in enumerate(frames))
    return [view_record(room, view, printed) for view in views]


def view_record(room: int, view: CaveView, printed: Sequence[PrintedArray]) -> ViewRecord:
    """Return what is kept of a view; rendering is timed for several views at once, and so not for this one."""
    camera = view.frame.camera
    return ViewRecord(
        room=room,
        camera=f"{camera.width}×{camera.height}",
        frame=replace(view.record(), time_s=view.reading.time_s),
        markers=view.markers.markers,
        arrays=tuple(_array_record(view, array) for array in printed if array.name in view.arrays.in_view),
        poses=tuple(pose_records(view, printed)),
    )


def _array_record(view: CaveView, array: PrintedArray) -> ArrayRecord:
    marks = [t for t in view.frame.truth if t.name in array.marks]
    return ArrayRecord(
        name=array.name,
        side_px=min(t.side_px for t in marks),
        tilt_deg=max(t.tilt_deg for t in marks),
        is_decoded=array.name in view.arrays.decoded,
        is_decoded_by_paper=array.name in view.paper.decoded,
    )


def pose_records(view: CaveView, printed: Sequence[PrintedArray]) -> Iterator[PoseRecord]:
    """Yield the poses from each array alone, from all if they are several, and from one wall's if they are many."""
    places = array_map(printed)
    known = [array for array in view.reading.arrays if array.code in places]
    groups: list[tuple[PoseKind, list[MarkerArray]]] = [("one", [array]) for array in known]
    if len(known) >= SEVERAL:
        groups.append(("several", known))
    groups += [("wall", wall) for wall in _walls(known, places) if len(wall) >= WALL]
    for kind, arrays in groups:
        found = pose_from_arrays(view.frame.camera, arrays, places)
        if found is not None:
            yield pose_record(kind, len(arrays), found, view.frame.world_from_camera)


def _walls(known: Sequence[MarkerArray], places: Mapping[int, Place]) -> list[list[MarkerArray]]:
    """Return the arrays by the direction in which they face."""
    walls: dict[tuple[float, ...], list[MarkerArray]] = {}
    for array in known:
        assert array.code is not None
        facing = np.cross(*places[array.code].axes.T)
        walls.setdefault(tuple(np.round(facing, 3) + 0.0), []).append(array)
    return list(walls.values())


def pose_record(kind: PoseKind, arrays: int, found: PoseEstimate, truth: Pose) -> PoseRecord:
    """Return a pose's errors; it is flipped if the other pose that was found is nearer to the truth."""
    errors = pose_error(found.fit.world_from_camera, truth)
    other = None if found.rival is None else pose_error(found.rival.world_from_camera, truth)
    assert errors is not None
    is_flipped = other is not None and other[1] < errors[1]
    return PoseRecord(kind, arrays, errors[0], errors[1], is_flipped, found.is_certain)
