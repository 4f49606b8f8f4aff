"""Contradictions between a specification and the scenes it names, found before anything is rendered."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from peaksim.camera.calibration_file import colmap_line
from peaksim.camera.presets import sensor_named
from peaksim.camera.sensor import Sensor
from peaksim.corpus.coco import MOST_MARKERS
from peaksim.corpus.photographs import photographs
from peaksim.corpus.plan import MOST_ATTEMPTS, corpus_cameras, plan_frame, read_scene
from peaksim.corpus.sample import camera_values
from peaksim.corpus.spec import CorpusSpec
from peaksim.corpus.spec_scene import MarkerSpread
from peaksim.corpus.spec_sensor import sensor_value
from peaksim.corpus.spec_views import RandomView
from peaksim.corpus.vary import all_markers, markers_needed, poster_kinds
from peaksim.errors import InputError, SceneError
from peaksim.image_file import read_image_8_bits
from peaksim.scene.build_markers import marker_pattern
from peaksim.scene.build_quads import quad_pose
from peaksim.scene.file import build_setup
from peaksim.scene.schema import MarkerTable, RoomTable, SceneTable

_SEQUENCES = 3  # sequences whose first view is drawn before a corpus begins


def check_spec(spec: CorpusSpec, folder: Path) -> None:
    """Refuse a specification that its scenes cannot fulfil.

    Raises
    ------
    SceneError
        One line that names the field, what was expected and what came.
    """
    tables = [read_scene(choice.file, folder) for choice in spec.scenes]
    known = {name for table, _ in tables for name in table.textures}
    for name in spec.textures:
        if name not in known:
            raise SceneError(f"textures.{name}: expected a texture of the scenes ({', '.join(sorted(known))})")
    for choice, (table, beside) in zip(spec.scenes, tables, strict=True):
        try:
            probe = table.model_copy(update={"markers": _probes(table, spec), "marker_paths": ()})
            _check_sensors(spec, build_setup(probe, beside).sensor)
            _check_scene(spec, table)
        except SceneError as error:
            raise SceneError(f"{choice.file}: {error}") from error
    for named in corpus_cameras(spec, folder):
        try:
            colmap_line(camera_values(named.camera))
        except InputError as error:
            raise SceneError(f"cameras.{named.name}: {error}") from error
    if spec.warped is not None:
        _check_sensors(spec, Sensor())
        for file in photographs(folder, spec.warped.photographs).values():
            read_image_8_bits(file)
        for kind in spec.warped.kinds:
            marker_pattern(kind, "warped.kinds")
    for sequence in range(min(spec.sequences, _SEQUENCES)):
        plan_frame(spec, folder, sequence * spec.sequence_frames, attempts=MOST_ATTEMPTS // 10)


def _check_sensors(spec: CorpusSpec, scene_sensor: Sensor) -> None:
    """Refuse sensors that cannot be, or whose images the files cannot hold, among those that can be drawn."""
    highest = {name: sensor_value(name, values.limits[1]) for name, values in spec.sensor.spreads.items()}
    bases = [sensor_named(name) for name in spec.sensor.presets or ()] or [scene_sensor]
    for sensor in (replace(base, **highest) for base in bases):  # type: ignore[arg-type]
        if sensor.bits > 8 and spec.pictures.format == "jpeg":
            raise SceneError(f"pictures.format: expected png for a sensor of {sensor.bits} bits, got jpeg")


def _probes(table: SceneTable, spec: CorpusSpec) -> tuple[MarkerTable, ...]:
    """Return one of the scene's markers in every kind that can come: building them proves that the kinds exist."""
    return tuple(
        m.model_copy(update={"kind": kind, "name": f"probe {kind}"})
        for m in all_markers(table)[:1]
        for kind in spec.markers.kinds
    )


def _check_scene(spec: CorpusSpec, table: SceneTable) -> None:
    markers = all_markers(table)
    count = len(markers) + len(poster_kinds(table))
    if count >= MOST_MARKERS:
        raise SceneError(f"markers: expected fewer than {MOST_MARKERS}, got {count}")
    if (needed := markers_needed(spec)) > count:
        raise SceneError(f"views: expected a scene with at least {needed} markers, this one has {count}")
    for i, view in enumerate(spec.views):
        if isinstance(view, RandomView) and table.room is not None:
            _check_eyes(view, table.room, f"views[{i}].eye_m")
    if (spec.clutter.papers.limits[1] or spec.clutter.boxes.limits[1]) and table.room is None:
        raise SceneError("clutter: expected a scene with a room to put it in, this one has none")
    if spec.light is not None and spec.light.has_lamps and table.room is None:
        raise SceneError("light.lamps: expected a scene with a room to hang them in, this one has none")
    if table.room is not None:
        for marker in markers:
            _check_marker(marker, spec.markers, table.room)


def _check_eyes(view: RandomView, room: RoomTable, field: str) -> None:
    """Refuse a box of eyes that has no point in the room."""
    for axis, spread, low, high in zip("xyz", view.eye_m, room.min_m, room.max_m, strict=True):
        least, most = spread.limits
        if most <= low or least >= high:
            raise SceneError(f"{field}: expected {axis} inside the room {low:g}…{high:g}, got {least:g}…{most:g}")


def _check_marker(marker: MarkerTable, spread: MarkerSpread, room: RoomTable) -> None:
    """Refuse shifts, rotations and sizes that can push a marker out of the room: its farthest circle must be inside."""
    if spread == MarkerSpread(kinds=spread.kinds, keep=spread.keep):
        return
    shift = np.sqrt(2) * max(abs(limit) for limit in spread.shift_m.limits)
    reach = shift + np.sqrt(2) * (marker.side_m / 2 + marker.border_m) * spread.side_factor.limits[1]
    normal = quad_pose(marker.normal, marker.up, marker.center_m, marker.name)[:3, 2]
    extent = reach * np.sqrt(1 - np.clip(normal**2, 0, 1))
    low, high = np.array(marker.center_m) - extent, np.array(marker.center_m) + extent
    if not ((low >= np.array(room.min_m) - 1e-9) & (high <= np.array(room.max_m) + 1e-9)).all():
        raise SceneError(
            f"markers: expected shifts and sizes that keep every marker in the room, "
            f"{marker.name!r} can leave it by up to {_outside(low, high, room):.3g} m"
        )


def _outside(low: np.ndarray, high: np.ndarray, room: RoomTable) -> float:
    return float(max((np.array(room.min_m) - low).max(), (high - np.array(room.max_m)).max()))
