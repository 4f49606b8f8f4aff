"""What an experiment has finished, on disk, so that an interrupted run resumes where it stopped.

`OUT/journal.jsonl` holds the configuration in its first line and a finished item in each of the others, appended as
they come; what belongs to an item but is no plain value (the image of a frame, a film) lies in `OUT/journal/`.
"""

import json
import os
import shutil
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from peakmark.errors import InputError
from peakmark.plain import to_plain


class Records(Mapping[str, Any]):
    """Name of a finished item → its record, plain values; they stay on disk, so that memory does not grow with them."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._starts: dict[str, int] = {}

    def note(self, line: bytes, start: int) -> None:
        """Take in a line of the journal and where it starts; half a line, left by a run that was killed, is none."""
        entry = _entry(line)
        if entry is not None:
            self._starts[entry["item"]] = start

    def forget(self) -> None:
        """Hold nothing any more."""
        self._starts.clear()

    def __getitem__(self, name: str) -> Any:
        with self._path.open("rb") as file:
            file.seek(self._starts[name])
            return json.loads(file.readline())["record"]

    def __contains__(self, name: object) -> bool:
        return name in self._starts

    def __iter__(self) -> Iterator[str]:
        return iter(self._starts)

    def __len__(self) -> int:
        return len(self._starts)


@dataclass(frozen=True)
class Journal:
    """The finished items of a run, on disk."""

    path: Path
    """journal.jsonl."""
    records: Records
    """Those items."""

    @classmethod
    def open(cls, out: str | Path, configuration: Mapping[str, Any], is_resumed: bool = True) -> Self:
        """Read what an earlier run into `out` left, or begin anew where there is nothing, or it is not to be resumed.

        `out` is made if missing; the configuration is plain values that decide what the records hold.

        Raises
        ------
        InputError
            If `out` cannot be written, or holds the journal of another configuration.
        """
        path = Path(out) / "journal.jsonl"
        journal = cls(path, Records(path))
        expected = json.loads(json.dumps(configuration))
        try:
            if not is_resumed:
                journal.remove()
            journal.path.parent.mkdir(parents=True, exist_ok=True)
            if not journal.path.exists():
                journal._append(expected)
            with journal.path.open("rb") as file:
                journal._check(file.readline(), expected)
                start = file.tell()
                for line in file:
                    journal.records.note(line, start)
                    start += len(line)
        except OSError as error:
            raise InputError(
                f"--out {out}: expected a folder that can be written: {error.strerror or error}"
            ) from error
        return journal

    def _check(self, first: bytes, expected: dict[str, Any]) -> None:
        try:
            found = json.loads(first)
        except ValueError as error:
            raise InputError(f"{self.path}: is damaged, its first line is no configuration: {error}") from error
        for name, value in expected.items():
            was = found.get(name) if isinstance(found, dict) else None
            if was != value:
                raise InputError(
                    f"{self.path}: holds a run of another configuration: {name} was {was!r}, is {value!r}; "
                    "give another --out"
                )

    def add(self, name: str, record: Any) -> None:
        """Keep one finished item."""
        self.records.note(*self._append({"item": name, "record": record}))

    def _append(self, value: Any) -> tuple[bytes, int]:
        """Return the line that was added, and where it starts."""
        line = json.dumps(value).encode() + b"\n"
        with self.path.open("ab") as file:
            if file.tell() and not _ends_a_line(self.path):
                file.write(b"\n")
            start = file.tell()
            file.write(line)
        return line, start

    def file(self, name: str) -> Path:
        """Return where a file that belongs to an item lies; its folder is there."""
        folder = self.path.with_suffix("")
        folder.mkdir(exist_ok=True)
        return folder / name

    def remove(self) -> None:
        """Delete what was kept: the results hold it now, or it is not wanted."""
        self.path.unlink(missing_ok=True)
        self.remove_files()
        self.records.forget()

    def remove_files(self) -> None:
        """Delete the files that belong to items; their records stay."""
        shutil.rmtree(self.path.with_suffix(""), ignore_errors=True)


def journal_key(values: Any) -> dict[str, Any]:
    """Return the plain values of a configuration or camera that decide what records hold.

    Samples count only for the renderers that take them, and sensor and baking only where they are not the
    default, so that journals from before them still fit.
    """
    plain: dict[str, Any] = to_plain(values)
    if plain.get("renderer") not in ("traced", "pyrender"):
        plain.pop("samples", None)
    for name, default in (("sensor", None), ("bake", True)):
        if plain.get(name, not default) == default:
            del plain[name]
    for part in (plain, plain.get("camera", {})):
        if part.get("thin_lens", "none") is None:
            del part["thin_lens"]
    return plain


def _entry(line: bytes) -> dict[str, Any] | None:
    """Return the item and its record of a line; None where a run that was killed while writing left half of one."""
    try:
        entry = json.loads(line)
    except ValueError:
        return None
    is_item = isinstance(entry, dict) and isinstance(entry.get("item"), str) and "record" in entry
    return entry if is_item else None


def _ends_a_line(path: Path) -> bool:
    with path.open("rb") as file:
        file.seek(-1, os.SEEK_END)
        return file.read(1) == b"\n"
