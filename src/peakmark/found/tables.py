"""Rows as files and data frames: CSV, JSON lines and Parquet, chosen by the file's ending."""

import csv
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, fields
from itertools import islice
from pathlib import Path
from typing import Any

from peaksim.extras import needs_extra
from peaksim.whole_file import whole_file

from peakmark.errors import InputError
from peakmark.found.rows import FoundRow

COLUMNS = tuple(field.name for field in fields(FoundRow))
CORNER_COLUMNS = tuple(f"{axis}{corner}" for corner in range(4) for axis in "xy")
"""What stands in CSV and data frames for `corners`: x0, y0, … y3."""


_BATCH = 256
"""Rows of a row group of a Parquet file, all that is in memory at once."""


def write_rows(path: Path, rows: Iterable[FoundRow]) -> None:
    """Write rows as they come, the file whole or not at all; none gives a file with a head alone.

    Raises
    ------
    InputError
        If the name ends in something other than .csv, .jsonl or .parquet, or cannot be written.
    """
    write = writer_of(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(path) as unfinished:
            write(unfinished, rows)
    except OSError as error:
        raise InputError(f"--out {path}: expected a file that can be written: {error.strerror or error}") from error


def writer_of(path: Path) -> Callable[[Path, Iterable[FoundRow]], None]:
    """Return what writes rows to a file by this file's ending; another ending than those three is an `InputError`."""
    write = {".csv": _csv, ".jsonl": _json_lines, ".parquet": _parquet}.get(path.suffix)
    if write is None:
        raise InputError(f"--out {path}: expected a name ending in .csv, .jsonl or .parquet")
    return write


def data_frame(rows: Sequence[FoundRow]) -> Any:
    """Return rows as a `pandas.DataFrame`; without pandas an `InputError` says how to install it."""
    return frame_of([_flat(row) for row in rows], _FLAT_COLUMNS)


def frame_of(rows: Sequence[Mapping[str, Any]], columns: Sequence[str] | None = None) -> Any:
    """Return plain values by name as a `pandas.DataFrame`; without pandas an `InputError` says how to install it."""
    try:
        import pandas
    except ImportError as error:
        raise InputError("to_dataframe needs pandas: pip install 'peakmark[pandas]'") from error
    return pandas.DataFrame(list(rows), columns=columns)


_FLAT_COLUMNS = [*(name for name in COLUMNS if name not in ("corners", "doubt")), *CORNER_COLUMNS, "doubt"]


def _flat(row: FoundRow) -> dict[str, Any]:
    values = asdict(row)
    corners = dict(zip(CORNER_COLUMNS, (value for corner in values.pop("corners") for value in corner), strict=True))
    return values | corners


def _csv(path: Path, rows: Iterable[FoundRow]) -> None:
    with path.open("w", newline="", encoding="utf-8", errors="backslashreplace") as file:
        writer = csv.DictWriter(file, _FLAT_COLUMNS)
        writer.writeheader()
        writer.writerows(_flat(row) for row in rows)


def _json_lines(path: Path, rows: Iterable[FoundRow]) -> None:
    with path.open("w", newline="", encoding="utf-8", errors="backslashreplace") as file:
        file.writelines(json.dumps(asdict(row), ensure_ascii=False, allow_nan=False) + "\n" for row in rows)


@needs_extra
def _parquet(path: Path, rows: Iterable[FoundRow]) -> None:
    import pyarrow as pa
    from pyarrow import parquet

    number = pa.float64()
    kinds = {"frame": pa.int64(), "code": pa.int64(), "corners": pa.list_(pa.list_(number, 2), 4)}
    kinds |= dict.fromkeys(("file", "kind", "polarity", "doubt", "pattern"), pa.string())
    schema = pa.schema([(name, kinds.get(name, number)) for name in COLUMNS])
    left = iter(rows)
    with parquet.ParquetWriter(path, schema) as writer:
        while batch := list(islice(left, _BATCH)):
            writer.write_table(pa.Table.from_pylist([asdict(row) for row in batch], schema))
