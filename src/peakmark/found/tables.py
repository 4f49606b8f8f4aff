"""Rows as files and data frames: CSV, JSON lines and Parquet, chosen by the file's ending."""

import csv
import io
import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from peaksim.extras import needs_extra
from peaksim.whole_file import write_whole

from peakmark.errors import InputError
from peakmark.found.rows import FoundRow

COLUMNS = tuple(field.name for field in fields(FoundRow))
CORNER_COLUMNS = tuple(f"{axis}{corner}" for corner in range(4) for axis in "xy")
"""What stands in CSV and data frames for `corners`: x0, y0, … y3."""


def write_rows(path: Path, rows: Sequence[FoundRow]) -> None:
    """Write rows, the file whole or not at all; none gives a file with a head alone.

    Raises
    ------
    InputError
        If the name ends in something other than .csv, .jsonl or .parquet, or cannot be written.
    """
    write = writer_of(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, write(rows))
    except OSError as error:
        raise InputError(f"--out {path}: expected a file that can be written: {error.strerror or error}") from error


def writer_of(path: Path) -> Callable[[Sequence[FoundRow]], bytes]:
    """Return what makes a file's content of rows; another ending than those three is an `InputError`."""
    write = {".csv": _csv, ".jsonl": _json_lines, ".parquet": _parquet}.get(path.suffix)
    if write is None:
        raise InputError(f"--out {path}: expected a name ending in .csv, .jsonl or .parquet")
    return write


def data_frame(rows: Sequence[FoundRow]) -> Any:
    """Return rows as a `pandas.DataFrame`; without pandas an `InputError` says how to install it."""
    try:
        import pandas
    except ImportError as error:
        raise InputError("to_dataframe needs pandas: pip install pandas") from error
    return pandas.DataFrame([_flat(row) for row in rows], columns=_FLAT_COLUMNS)


_FLAT_COLUMNS = [*(name for name in COLUMNS if name not in ("corners", "doubt")), *CORNER_COLUMNS, "doubt"]


def _flat(row: FoundRow) -> dict[str, Any]:
    values = asdict(row)
    corners = dict(zip(CORNER_COLUMNS, (value for corner in values.pop("corners") for value in corner), strict=True))
    return values | corners


def _csv(rows: Sequence[FoundRow]) -> bytes:
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, _FLAT_COLUMNS)
    writer.writeheader()
    writer.writerows(_flat(row) for row in rows)
    return text.getvalue().encode("utf-8", "backslashreplace")


def _json_lines(rows: Sequence[FoundRow]) -> bytes:
    lines = [json.dumps(asdict(row), ensure_ascii=False, allow_nan=False) + "\n" for row in rows]
    return "".join(lines).encode("utf-8", "backslashreplace")


@needs_extra
def _parquet(rows: Sequence[FoundRow]) -> bytes:
    import pyarrow as pa
    from pyarrow import parquet

    number = pa.float64()
    kinds = {"frame": pa.int64(), "code": pa.int64(), "corners": pa.list_(pa.list_(number, 2), 4)}
    kinds |= dict.fromkeys(("file", "kind", "polarity", "doubt"), pa.string())
    schema = pa.schema([(name, kinds.get(name, number)) for name in COLUMNS])
    sink = pa.BufferOutputStream()
    parquet.write_table(pa.Table.from_pylist([asdict(row) for row in rows], schema), sink)
    return bytes(sink.getvalue())
