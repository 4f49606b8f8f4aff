"""Result folders: files appear there whole, and all together, or not at all."""

import csv
import json
import os
import shutil
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from peaksim.folder_lock import lock_folder

from peakmark.errors import InputError
from peakmark.plain import to_plain

if sys.platform != "win32":
    import resource


@contextmanager
def result_folder(out: str | Path) -> Iterator[Path]:
    """Give a folder to write results in; they move to `out` when the block ends without an exception.

    `out` is made where missing; files of the same name in it are replaced, others stay.

    Raises
    ------
    InputError
        If `out` is a file, cannot be written, or has no room; nothing is left behind then.
    """
    target = Path(out)
    is_new = not target.exists()
    try:
        stage, lock = _stage(target)
        try:
            yield stage
            _publish(stage, target)
        finally:
            shutil.rmtree(stage, ignore_errors=True)
            if lock is not None:
                os.close(lock)
            if is_new and not any(target.iterdir()):
                target.rmdir()
    except OSError as error:
        raise InputError(f"--out {out}: expected a folder that can be written: {error.strerror or error}") from error


def _stage(target: Path) -> tuple[Path, int | None]:
    """Make a hidden folder inside `target`, so that the final renames stay on one file system; return it and its lock.

    The kernel takes the lock from a run that is killed, by which the next one knows what that left behind.
    """
    if target.exists() and not target.is_dir():
        raise InputError(f"--out {target}: expected a folder, found a file")
    target.mkdir(parents=True, exist_ok=True)
    guard = _lock(target, wait=True)  # between making and locking a folder, no other run takes it for left behind
    try:
        for old in target.glob(".unfinished-*") if guard is not None else ():
            lock = _lock(old, wait=False)
            if lock is not None:
                shutil.rmtree(old, ignore_errors=True)
                os.close(lock)
        stage = Path(tempfile.mkdtemp(prefix=".unfinished-", dir=target))
        return stage, _lock(stage, wait=True)
    finally:
        if guard is not None:
            os.close(guard)


def _lock(folder: Path, *, wait: bool) -> int | None:
    """Return the descriptor that holds a folder's lock; None where another run has it, or file systems have none."""
    with suppress(OSError):
        return lock_folder(folder, wait=wait)
    return None


def _publish(stage: Path, target: Path) -> None:
    """Move every file to where it belongs; `result.json` last, so that it vouches for the others."""
    for path in sorted(stage.iterdir(), key=lambda p: (p.name == "result.json", p.name)):
        destination = target / path.name
        if path.is_dir() and destination.is_dir():
            shutil.rmtree(destination)
        os.replace(path, destination)


def write_json(path: Path, value: Any) -> None:
    """Write plain values, or records of them (`to_plain`), as indented JSON; nan is refused, None is null."""
    text = json.dumps(to_plain(value), indent=2, allow_nan=False, ensure_ascii=False)
    path.write_bytes((text + "\n").encode("utf-8", "backslashreplace"))  # a file name may be no UTF-8: \udc80 in JSON


def peak_memory_mb() -> float | None:
    """Return the largest resident size of this process so far, in 10⁶ bytes; None on Windows, which does not tell."""
    if sys.platform == "win32":
        return None
    unit = 1 if sys.platform == "darwin" else 1024  # bytes there, elsewhere 1024 of them
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e6


def write_rows(path: Path, rows: Sequence[Any]) -> None:
    """Write a CSV line for each dictionary or record; nested figures become columns such as localisation_px.rms."""
    flat = [dict(_flat(to_plain(row))) for row in rows]
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, fieldnames=list(flat[0]))
        writer.writeheader()
        writer.writerows(flat)


def _flat(row: dict[str, Any], prefix: str = "") -> list[tuple[str, Any]]:
    columns: list[tuple[str, Any]] = []
    for name, value in row.items():
        if isinstance(value, dict):
            columns += _flat(value, f"{prefix}{name}.")
        else:
            columns.append((prefix + name, " ".join(map(str, value)) if isinstance(value, list) else value))
    return columns
