"""The finished frames of a flight on disk, so that an interrupted one goes on where it stopped.

`OUT/frames/` holds `flight.json`, which says of which flight, and `000000.json` and `000000.jpg` for each frame that
is done; each file appears whole.
"""

import json
import os
import shutil
from dataclasses import asdict
from hashlib import sha256
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from peakmark.errors import InputError
from peakmark.experiments.floor.flight import Flight

FOLDER = "frames"
_QUALITY = 85


def open_store(out: str | Path, flight: Flight, is_resumed: bool) -> Path:
    """Return the folder of the finished frames, emptied unless the flight is resumed.

    Raises
    ------
    InputError
        If `out` cannot be written, or holds the frames of another flight.
    """
    store = Path(out) / FOLDER
    try:
        if not is_resumed:
            shutil.rmtree(store, ignore_errors=True)
        store.mkdir(parents=True, exist_ok=True)
        identity, file = _identity(flight), store / "flight.json"
        if file.exists():
            _check_same(json.loads(file.read_text(encoding="utf-8")), identity, out)
        else:
            _write(file, json.dumps(identity, indent=2).encode())
    except OSError as error:
        raise InputError(f"--out {out}: expected a folder that can be written: {error.strerror or error}") from error
    except json.JSONDecodeError as error:
        raise InputError(f"--out {out}: {FOLDER}/flight.json is damaged: {error}") from error
    return store


def _identity(flight: Flight) -> dict[str, Any]:
    poses = np.ascontiguousarray(flight.ride.trajectory.world_from_camera)
    return {
        **asdict(flight.config),
        "camera": {name: value for name, value in asdict(flight.ride.camera).items() if value is not None},
        "poses_sha256": sha256(poses.tobytes()).hexdigest(),
    }


def _check_same(found: Any, expected: dict[str, Any], out: str | Path) -> None:
    expected = json.loads(json.dumps(expected))
    for name, value in expected.items():
        was = found.get(name) if isinstance(found, dict) else None
        if was != value:
            raise InputError(f"--resume: {out} holds frames of another flight: {name} was {was!r}, is {value!r}")


def save_frame(store: Path, record: dict[str, Any], picture: NDArray[np.uint8]) -> None:
    """Write a frame's record and RGB picture; the record last, for it says that the frame is done."""
    buffer = BytesIO()
    Image.fromarray(picture).save(buffer, "JPEG", quality=_QUALITY)
    name = f"{record['frame']:06d}"
    _write(store / f"{name}.jpg", buffer.getvalue())
    _write(store / f"{name}.json", json.dumps(record).encode())


def _write(path: Path, content: bytes) -> None:
    unfinished = path.with_suffix(".unfinished")
    unfinished.write_bytes(content)
    os.replace(unfinished, path)


def is_done(store: Path, index: int) -> bool:
    """Return whether a frame is finished."""
    return (store / f"{index:06d}.json").is_file()


def load_record(store: Path, index: int) -> dict[str, Any]:
    """Return a finished frame's record."""
    record: dict[str, Any] = json.loads((store / f"{index:06d}.json").read_text(encoding="utf-8"))
    return record


def load_picture(store: Path, index: int) -> NDArray[np.uint8]:
    """Return a finished frame's (H, W, 3) RGB picture."""
    with Image.open(store / f"{index:06d}.jpg") as picture:
        return np.asarray(picture.convert("RGB"))
