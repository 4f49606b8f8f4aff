"""Key points on disk: .npz (exact), .csv (one row a key point) and .json (columns), chosen by the file's ending.

All three hold the columns of `Keypoints` under their names, and `settings`: the parameters that made them, as JSON
text. In CSV, `xy` is split into x and y, descriptors into d0, d1, …, and the settings are a first line `# {…}`.
Numbers are written with as many digits as their dtype needs, so reading gives back the same bits.
"""

import csv
import io
import json
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from peakmark.errors import InputError

_REQUIRED = ("xy", "size", "angle", "response", "octave", "laplacian")
_OPTIONAL = ("scale", "descriptors")


Columns = dict[str, NDArray[Any]]
"""Name → column of `Keypoints`; descriptors may be absent."""


def write_columns(columns: Columns, path: Path, settings: Mapping[str, object]) -> None:
    """Write key points' columns and the settings that made them; see `Keypoints.save`.

    Raises
    ------
    InputError
        If the name ends in something other than .npz, .csv or .json.
    """
    write = {".npz": _npz_bytes, ".csv": _csv_bytes, ".json": _json_bytes}.get(path.suffix)
    if write is None:
        raise InputError(f"{path}: expected a name ending in .npz, .csv or .json")
    path.write_bytes(write(columns, json.dumps(settings)))


def read_columns(path: Path) -> Columns:
    """Read what `write_columns` wrote, or any .npz with the same column names; `scale` defaults to `size`.

    Raises
    ------
    InputError
        If the file is missing, damaged, or lacks a column.
    """
    columns = _read(path)
    missing = [name for name in _REQUIRED if name not in columns]
    if missing:
        raise InputError(f"{path}: expected columns {', '.join(_REQUIRED)}; {', '.join(missing)} missing")
    columns.setdefault("scale", columns["size"])
    return {name: columns[name] for name in (*_REQUIRED, *_OPTIONAL) if name in columns}


def load_settings(path: Path) -> dict[str, Any]:
    """Read the settings kept beside key points; empty where there are none."""
    settings: dict[str, Any] = json.loads(str(_read(path).get("settings", "{}")))
    return settings


def _read(path: Path) -> dict[str, Any]:
    readers: dict[str, Callable[[bytes], dict[str, Any]]]
    readers = {".npz": _from_npz, ".csv": _from_csv, ".json": _from_json}
    if path.suffix not in readers:
        raise InputError(f"{path}: expected a name ending in .npz, .csv or .json")
    try:
        return readers[path.suffix](path.read_bytes())
    except (OSError, EOFError, KeyError, ValueError, zipfile.BadZipFile) as error:
        raise InputError(f"{path}: expected key points as written by peakmark, got {error}") from error


def _npz_bytes(columns: Columns, settings: str) -> bytes:
    buffer = io.BytesIO()
    named: dict[str, Any] = {**columns, "settings": np.array(settings)}
    np.savez_compressed(buffer, **named)
    return buffer.getvalue()


def _from_npz(data: bytes) -> dict[str, Any]:
    with np.load(io.BytesIO(data), allow_pickle=False) as archive:
        return {name: archive[name] for name in archive.files}


def _json_bytes(columns: Columns, settings: str) -> bytes:
    length = columns["descriptors"].shape[1] if "descriptors" in columns else None
    values = {name: _as_digits(column).tolist() for name, column in columns.items()}
    return json.dumps({"settings": json.loads(settings), "descriptor_length": length, **values}).encode()


def _from_json(data: bytes) -> dict[str, Any]:
    columns: dict[str, Any] = json.loads(data)
    columns["settings"] = json.dumps(columns.get("settings", {}))
    columns["xy"] = np.reshape(columns["xy"], (-1, 2))
    if "descriptors" in columns:
        columns["descriptors"] = np.reshape(columns["descriptors"], (-1, columns["descriptor_length"]))
    return columns


def _csv_bytes(columns: Columns, settings: str) -> bytes:
    table = {"x": columns["xy"][:, 0], "y": columns["xy"][:, 1]}
    table |= {name: columns[name] for name in (*_REQUIRED[1:], "scale")}
    table |= {f"d{entry}": column for entry, column in enumerate(columns.get("descriptors", np.zeros((0, 0))).T)}
    text = io.StringIO()
    text.write(f"# {settings}\n")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(table)
    writer.writerows(zip(*(_as_digits(column).tolist() for column in table.values()), strict=True))
    return text.getvalue().encode()


def _from_csv(data: bytes) -> dict[str, Any]:
    first, _, rest = data.decode("utf-8-sig").partition("\n")
    header, *rows = list(csv.reader(io.StringIO(rest)))
    values = np.array(rows, dtype=np.float64).reshape(len(rows), len(header))
    table = dict(zip(header, values.T, strict=True))
    columns: dict[str, Any] = {name: table[name] for name in (*_REQUIRED[1:], "scale") if name in table}
    columns["xy"] = np.stack([table["x"], table["y"]], axis=1)
    columns["settings"] = first.removeprefix("# ")
    length = sum(name[0] == "d" and name[1:].isdigit() for name in header)
    if length:
        columns["descriptors"] = np.stack([table[f"d{entry}"] for entry in range(length)], axis=1)
    return columns


def _as_digits(column: NDArray[Any]) -> NDArray[Any]:
    """Floats as the float64 with the shortest text that reads back as the same float32."""
    if column.dtype != np.float32:
        return column
    return np.array([float(str(value)) for value in column.ravel()]).reshape(column.shape)
