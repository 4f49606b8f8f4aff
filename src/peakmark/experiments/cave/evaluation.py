"""How well arrays are read: random views of random rooms that had no part in any tuning, scored one by one."""

import json
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any, get_args

import numpy as np
from peaksim.geometry.pose import Pose

from peakmark.arrays.decode import MarkerArray
from peakmark.errors import InputError
from peakmark.experiments.cave.rooms import Split
from peakmark.experiments.cave.samples import room_and_frames
from peakmark.experiments.cave.walk import View, judged, places_of
from peakmark.localise.from_arrays import Place, pose_from_arrays
from peakmark.localise.pose import PoseEstimate
from peakmark.parallel import set_thread_count
from peakmark.score.arrays import PrintedArray, printed_arrays
from peakmark.score.poses import pose_error
from peakmark.score.wanted import STEEPEST_DEG

SEVERAL, WALL = 3, 5
"""Fewest arrays for a pose from several, and from a whole wall."""

RECORDS = "records"


@dataclass(frozen=True)
class EvaluationConfig:
    """What to evaluate on."""

    rooms: int = 55
    """Random rooms."""
    views: int = 10
    """Random cameras a room; a few find no free place."""
    split: Split = "held-out"
    """"held-out" or "training"."""
    size: float = 0.5
    """Share of the cameras' width and height that the pictures have: at 1 a view takes four times as long."""
    seed: int = 1
    """Of rooms, views and noise; the classifier's samples come from others."""

    def __post_init__(self) -> None:
        for name, value, fits, expected in (
            ("rooms", self.rooms, 1 <= self.rooms <= 100_000, "1…100000"),
            ("views", self.views, 1 <= self.views <= 1000, "1…1000"),
            ("size", self.size, 0.1 <= self.size <= 1, "0.1…1"),
            ("seed", self.seed, self.seed >= 0, "0 or more"),
            ("split", self.split, self.split in get_args(Split), " or ".join(get_args(Split))),
        ):
            if not fits:
                raise InputError(f"--{name}: expected {expected}, got {value}")


def evaluate(
    config: EvaluationConfig, out: Path, workers: int = 1, on_room: Callable[[], None] = lambda: None
) -> list[dict[str, Any]]:
    """Return the records of all views; rooms that `out` already holds are not rendered again.

    Raises
    ------
    InputError
        If the number of workers is below 1, or `out` cannot be written or holds another evaluation.
    """
    if workers < 1:
        raise InputError(f"--workers: expected 1 or more, got {workers}")
    store = _open_store(config, out)
    missing = [room for room in range(config.rooms) if not _file(store, room).exists()]
    for _ in range(config.rooms - len(missing)):
        on_room()
    for room, records in _computed(config, missing, workers):
        _write(_file(store, room), json.dumps(records))
        on_room()
    return [r for room in range(config.rooms) for r in json.loads(_file(store, room).read_text(encoding="utf-8"))]


def _computed(config: EvaluationConfig, rooms: list[int], workers: int) -> Iterator[tuple[int, list[dict[str, Any]]]]:
    if workers == 1:
        yield from ((room, room_records(config, room)) for room in rooms)
        return
    with ProcessPoolExecutor(workers, get_context("spawn"), initializer=set_thread_count, initargs=(1,)) as pool:
        futures = {pool.submit(room_records, config, room): room for room in rooms}
        for future in as_completed(futures):
            yield futures[future], future.result()


def _open_store(config: EvaluationConfig, out: Path) -> Path:
    store, identity = out / RECORDS, {k: v for k, v in asdict(config).items() if k != "rooms"}
    try:
        store.mkdir(parents=True, exist_ok=True)
        file = store / "config.json"
        if not file.exists():
            _write(file, json.dumps(identity))
        elif json.loads(file.read_text(encoding="utf-8")) != identity:
            raise InputError(f"--out {out}: holds another evaluation; expected {identity}")
    except OSError as error:
        raise InputError(f"--out {out}: expected a folder that can be written: {error.strerror or error}") from error
    except json.JSONDecodeError as error:
        raise InputError(f"--out {out}: {RECORDS}/config.json is damaged: {error}") from error
    return store


def _file(store: Path, room: int) -> Path:
    return store / f"room{room:05d}.json"


def _write(path: Path, text: str) -> None:
    """Write a file that appears whole."""
    unfinished = path.with_suffix(".unfinished")
    unfinished.write_text(text, encoding="utf-8")
    os.replace(unfinished, path)


def room_records(config: EvaluationConfig, room: int) -> list[dict[str, Any]]:
    """Return one room's views as plain values."""
    scene, frames = room_and_frames(config.split, room, config.views, config.seed, STEEPEST_DEG, config.size)
    printed = printed_arrays(scene.scene)
    return [record(room, judged(index, frame, scene.scene, 0.0), printed) for index, frame in enumerate(frames)]


def record(room: int, view: View, printed: Sequence[PrintedArray]) -> dict[str, Any]:
    """Return what is kept of a view."""
    row = view.row()
    del row["missed"], row["time_on_path_s"], row["time_s"]["render"]
    return {
        "room": room,
        "camera": f"{view.frame.camera.width}×{view.frame.camera.height}",
        **row,
        "markers": [asdict(marker) for marker in view.markers.markers],
        "arrays": [_array_row(view, array) for array in printed if array.name in view.arrays.in_view],
        "poses": list(poses(view, printed)),
    }


def _array_row(view: View, array: PrintedArray) -> dict[str, Any]:
    marks = [t for t in view.frame.truth if t.name in array.marks]
    return {
        "name": array.name,
        "side_px": min(t.side_px for t in marks),
        "tilt_deg": max(t.tilt_deg for t in marks),
        "is_decoded": array.name in view.arrays.decoded,
        "is_decoded_by_paper": array.name in view.paper.decoded,
    }


def poses(view: View, printed: Sequence[PrintedArray]) -> Iterator[dict[str, Any]]:
    """Yield the errors of the camera's pose from each array alone, from all if several, and from one wall's if many."""
    places = places_of(printed)
    known = [array for array in view.reading.arrays if array.code in places]
    groups = [("one", [array]) for array in known]
    if len(known) >= SEVERAL:
        groups.append(("several", known))
    groups += [("wall", wall) for wall in _walls(known, places) if len(wall) >= WALL]
    for kind, arrays in groups:
        found = pose_from_arrays(view.frame.camera, arrays, places)
        if found is not None:
            yield {"kind": kind, "arrays": len(arrays), **pose_row(found, view.frame.world_from_camera)}


def _walls(known: Sequence[MarkerArray], places: Mapping[int, Place]) -> list[list[MarkerArray]]:
    """Return the arrays by the direction in which they face."""
    walls: dict[tuple[float, ...], list[MarkerArray]] = {}
    for array in known:
        assert array.code is not None
        facing = np.cross(*places[array.code].axes.T)
        walls.setdefault(tuple(np.round(facing, 3) + 0.0), []).append(array)
    return list(walls.values())


def pose_row(found: PoseEstimate, truth: Pose) -> dict[str, Any]:
    """Return a pose's errors; it is flipped if the other pose that was found is nearer to the truth."""
    errors = pose_error(found.fit.world_from_camera, truth)
    other = None if found.rival is None else pose_error(found.rival.world_from_camera, truth)
    assert errors is not None
    is_flipped = other is not None and other[1] < errors[1]
    return {"mm": errors[0], "deg": errors[1], "is_flipped": is_flipped, "is_certain": found.is_certain}
