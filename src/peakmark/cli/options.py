"""Options that several commands share."""

from pathlib import Path
from typing import Annotated, Any

from peaksim.camera.presets import PRESETS
from typer import Option

Out = Annotated[Path, Option(help="Folder for the results; made if missing.")]
Quiet = Annotated[bool, Option("--quiet", help="Print nothing but errors.")]
UnusedSeed = Annotated[int, Option(hidden=True, help="Taken by every command; nothing here is random.")]
NoiseSeed = Annotated[int, Option(help="Seed of the sensor noise.")]
Samples = Annotated[int, Option(help="Paths a pixel of the traced renderer, samples of pyrender.")]
SensorName = Annotated[
    str | None, Option(help=f"Camera instead of the scene's sensor: {', '.join(PRESETS)}. [default: the scene's]")
]
Bake = Annotated[
    bool,
    Option(
        "--bake/--no-bake", help="Show lamps, windows and skies in exact and gl: their light, path-traced once a scene."
    ),
]
RoomsSeed = Annotated[int, Option(help="Seed of rooms, cameras and noise.")]
RoomViews = Annotated[int, Option(help="Random cameras a room.")]
Workers = Annotated[int | None, Option(help="Processes on this machine. [default: its processors]")]
Dask = Annotated[str | None, Option(help="Dask scheduler to work on, such as tcp://host:8786.")]


def drawn_by(renderer: str, samples: int, sensor: str | None, bake: bool, seed: int) -> dict[str, Any]:
    """Return the fields of `experiments.drawing.Drawing` that these options are, for a configuration's call."""
    return {"renderer": renderer, "samples": samples, "sensor": sensor, "bake": bake, "seed": seed}


def given(**options: Any) -> dict[str, Any]:
    """Return the options that were stated: neither None nor a switch left off."""
    return {name: value for name, value in options.items() if value is not None and value is not False}
