"""TOML → scene, camera, trajectory and sensor; every error names the file, the field and what was expected."""

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from peaksim import shipped
from peaksim.camera.camera import Camera
from peaksim.camera.presets import sensor_named
from peaksim.camera.sensor import Sensor
from peaksim.errors import InputError, SceneError
from peaksim.geometry.trajectory import Trajectory
from peaksim.scene import posters as scene_posters
from peaksim.scene.build_camera import build_camera, build_trajectory, check_camera
from peaksim.scene.build_lights import build_lights
from peaksim.scene.build_markers import marker_quads
from peaksim.scene.build_meshes import build_meshes, file_meshes
from peaksim.scene.build_quads import build_quads, room_quads
from peaksim.scene.named_material import load_materials
from peaksim.scene.paper import load_textures
from peaksim.scene.scene import Scene
from peaksim.scene.schema import SceneTable
from peaksim.scene.sheet_file import sheet_quads
from peaksim.toml_file import parse_toml, suggestion, validate


@dataclass(frozen=True)
class Setup:
    """What a scene file describes; also unpacks as `scene, camera, trajectory`."""

    scene: Scene
    """Everything that can be seen."""
    camera: Camera
    """The camera."""
    trajectory: Trajectory
    """Pose of the camera over time; one waypoint for a still view."""
    sensor: Sensor
    """What turns linear grey levels into the image."""

    def seen_by(self, sensor: str | None) -> "Setup":
        """Return the same with a camera's sensor by its name, see `peaksim.camera.presets`; None keeps the own one.

        Raises
        ------
        SceneError
            If there is no sensor of that name.
        """
        return self if sensor is None else replace(self, sensor=sensor_named(sensor))

    def __iter__(self) -> Iterator[Any]:
        return iter((self.scene, self.camera, self.trajectory))


def load_scene(
    path: str | Path, variants: Mapping[str, str] | None = None, kinds: Mapping[str, str] | None = None
) -> Setup:
    """Read a scene file.

    Parameters
    ----------
    path
        A TOML file, or the bare name of a scene that ships with the package, such as "floor".
    variants
        Texture name → variant, such as `{"floor": "brick"}`; the first variant listed is the default.
    kinds
        Kind of a marker → the one that hangs in its place, such as `{"surf-dark": "sift-dark"}`.

    Raises
    ------
    SceneError
        One line that names the file, the field, what was expected and what came.
    """
    table, folder = read_table(path)
    try:
        return build_setup(with_kinds(table, kinds or {}), folder, variants)
    except InputError as error:
        raise SceneError(f"{path}: {error}") from error


def read_table(path: str | Path) -> tuple[SceneTable, Path]:
    """Return what a scene file states, and its folder, which its image files are relative to.

    Raises
    ------
    SceneError
        As `load_scene`; whether textures and markers exist is not checked yet.
    """
    file = find_scene(path)
    return validate(SceneTable, parse_toml(file), str(file)), file.parent


def with_kinds(table: SceneTable, kinds: Mapping[str, str]) -> SceneTable:
    """Return a scene's table with other markers in the places of those of some kinds."""

    def named(part: Any) -> Any:
        return part.model_copy(update={"kind": kinds.get(part.kind, part.kind)})

    def lettered(part: Any) -> Any:
        return part.model_copy(update={"kinds": {letter: kinds.get(kind, kind) for letter, kind in part.kinds.items()}})

    changes = {
        "markers": [named(part) for part in table.markers],
        "marker_paths": [named(part) for part in table.marker_paths],
        "posters": [lettered(part) for part in table.posters],
    }
    return table.model_copy(update=changes) if kinds else table


def find_scene(path: str | Path) -> Path:
    """Return the file of a scene: a path, or the bare name of a shipped scene."""
    shipped_file = shipped.SCENES / f"{path}.toml"
    return shipped_file if Path(path).name == str(path) and os.path.isfile(shipped_file) else Path(path)


def find_scene_beside(folder: Path, file: str, field: str) -> Path:
    """Return the file of a scene that a file in `folder` names: one that lies there, or the name of a shipped scene.

    Raises
    ------
    SceneError
        If it leads elsewhere; the message starts with `field`.
    """
    if not os.path.isfile(folder / file) and (shipped_file := find_scene(file)) != Path(file):
        return shipped_file
    return shipped.path_inside(folder, file, field)


def build_setup(table: SceneTable, folder: Path, variants: Mapping[str, str] | None = None) -> Setup:
    """Build what a scene table states; image files are searched in `folder`, then among the assets.

    Raises
    ------
    SceneError
        One line that names the field, what was expected and what came.
    """
    materials = load_materials(table.materials)
    textures = load_textures(table.textures, variants or {}, folder, materials)
    scene = Scene(
        quads=(
            *room_quads(table.room, textures),
            *build_quads(table.quads, textures),
            *marker_quads(table.markers, table.marker_paths, table.room, materials, folder),
            *scene_posters.poster_quads(table.posters, table.room, materials, folder),
            *sheet_quads(table.sheets, table.room, folder, materials),
        ),
        meshes=(*build_meshes(table.boxes, table.tables, materials), *file_meshes(table.meshes, folder, materials)),
        lights=build_lights(table.lights, folder),
        background=table.background,
    )
    check_camera(table.trajectory, table.room)
    camera = build_camera(table.camera)
    return Setup(scene, camera, build_trajectory(table.trajectory), build_sensor(table.sensor))


def build_sensor(settings: Mapping[str, Any]) -> Sensor:
    """Return the sensor of a `[sensor]` table: a preset, if it names one, and what it changes.

    Raises
    ------
    SceneError
        For an unknown field or preset, or a field out of its range.
    """
    known = ["preset", *Sensor.__dataclass_fields__]
    for name in settings:
        if name not in known:
            raise SceneError(
                f"sensor.{name}: unknown field, expected one of {', '.join(known)}{suggestion(name, known)}"
            )
    changes = {name: value for name, value in settings.items() if name != "preset"}
    return replace(sensor_named(settings["preset"]) if "preset" in settings else Sensor(), **changes)
