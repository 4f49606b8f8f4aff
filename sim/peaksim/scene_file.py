"""TOML → scene, camera, trajectory and sensor; every error names the file, the field and what was expected."""

import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from peaksim import scene_build, shipped
from peaksim.camera import Camera
from peaksim.errors import InputError, SceneError
from peaksim.scene import Scene
from peaksim.scene_schema import SceneTable
from peaksim.sensor import Sensor
from peaksim.trajectory import Trajectory

_LARGEST_FILE = 1_000_000  # bytes


@dataclass(frozen=True)
class Setup:
    """What a scene file describes; also unpacks as `scene, camera, trajectory`."""

    scene: Scene
    """Everything that can be seen."""
    camera: Camera
    """The camera."""
    trajectory: Trajectory
    """Where the camera is over time; one waypoint for a still view."""
    sensor: Sensor
    """What happens to the picture after the lens."""

    def __iter__(self) -> Iterator[Any]:
        return iter((self.scene, self.camera, self.trajectory))


def load_scene(path: str | Path, variants: Mapping[str, str] | None = None) -> Setup:
    """Read a scene file.

    Parameters
    ----------
    path
        A TOML file, or the bare name of a scene that ships with the package, such as "floor".
    variants
        Texture name → variant, such as `{"floor": "brick"}`; the first variant listed is the default.

    Raises
    ------
    SceneError
        One line that names the file, the field, what was expected and what came.
    """
    file = _find(path)
    table = _validate(_parse(file))
    try:
        return _build(table, variants or {}, file.parent)
    except InputError as error:
        raise SceneError(f"{path}: {error}") from error


def texture_variants(path: str | Path) -> dict[str, tuple[str, ...]]:
    """Return the selectable variants of each texture of a scene file that has any."""
    table = _validate(_parse(_find(path)))
    return {name: tuple(t.variants) for name, t in table.textures.items() if t.variants}


def _find(path: str | Path) -> Path:
    shipped_file = shipped.SCENES / f"{path}.toml"
    return shipped_file if Path(path).name == str(path) and shipped_file.is_file() else Path(path)


def _parse(file: Path) -> tuple[Path, dict[str, Any]]:
    try:
        if file.stat().st_size > _LARGEST_FILE:
            raise SceneError(f"{file}: expected a scene file of at most {_LARGEST_FILE} bytes")
        return file, tomllib.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise SceneError(f"{file}: cannot be read: {error.strerror}") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise SceneError(f"{file}: is not TOML: {error}") from error


def _validate(parsed: tuple[Path, dict[str, Any]]) -> SceneTable:
    file, content = parsed
    try:
        return SceneTable.model_validate(content)
    except ValidationError as error:
        raise SceneError(f"{file}: {_first_fault(error)}") from error


def _first_fault(error: ValidationError) -> str:
    """Say in one line what is wrong with the first faulty field, and how many more there are."""
    faults = error.errors(include_url=False)
    # an unknown field explains a missing one beside it, so it is said first
    fault = min(faults, key=lambda f: f["type"] != "extra_forbidden")
    where = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in fault["loc"]).lstrip(".")
    more = f" (and {len(faults) - 1} more)" if len(faults) > 1 else ""
    return f"{where or 'file'}: {_what(fault)}{more}"


def _what(fault: Any) -> str:
    if fault["type"] == "extra_forbidden":
        return f"unknown field{_suggestion(fault['loc'])}"
    if fault["type"] == "missing":
        return "missing field"
    message = str(fault["msg"])
    if fault["type"] == "value_error":  # our own words already say what came
        return message.removeprefix("Value error, ")
    return f"{message[0].lower()}{message[1:]}, got {fault['input']!r:.80}"


def _suggestion(location: tuple[Any, ...]) -> str:
    """Name the closest known field of the same table."""
    model: Any = SceneTable
    for part in location[:-1]:
        if isinstance(part, str):
            fields = getattr(model, "model_fields", {})
            model = _table_type(fields[part].annotation) if part in fields else model
    close = get_close_matches(str(location[-1]), list(getattr(model, "model_fields", {})), n=1)
    return f" (did you mean {close[0]!r}?)" if close else ""


def _table_type(annotation: Any) -> Any:
    """Return the table class inside `tuple[X, ...]`, `dict[str, X]` or `X | None`."""
    for argument in getattr(annotation, "__args__", ()):
        if hasattr(argument, "model_fields"):
            return argument
        inner = _table_type(argument)
        if inner is not None:
            return inner
    return annotation if hasattr(annotation, "model_fields") else None


def _build(table: SceneTable, variants: Mapping[str, str], folder: Path) -> Setup:
    textures = scene_build.load_textures(table.textures, variants, folder)
    scene = Scene(
        quads=(*scene_build.room_quads(table.room, textures), *scene_build.quads(table.quads, textures),
               *scene_build.marker_quads(table.markers, table.marker_paths, table.room)),
        meshes=scene_build.meshes(table.boxes, table.tables),
        lights=scene_build.lights(table.lights),
        background=table.background,
    )  # fmt: skip
    scene_build.check_camera(table.trajectory, table.room)
    camera = scene_build.camera(table.camera)
    return Setup(scene, camera, scene_build.trajectory(table.trajectory), _sensor(table.sensor))


def _sensor(settings: Mapping[str, Any]) -> Sensor:
    known = list(Sensor.__dataclass_fields__)
    for name in settings:
        if name not in known:
            raise SceneError(f"sensor.{name}: unknown field, expected one of {', '.join(known)}")
    return Sensor(**settings)
