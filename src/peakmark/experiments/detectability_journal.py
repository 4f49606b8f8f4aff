"""Finished points on disk, so that an interrupted run goes on where it was."""

import json
import os
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from peakmark.errors import InputError
from peakmark.experiments.detectability_points import Config

Row = dict[str, Any]
"""One point through one detector: names and figures."""

_KEPT = ("trials", "seed", "extra", "is_paper")


@dataclass
class Journal:
    """Finished points, one JSON line each, after a first line that holds the configuration."""

    path: Path
    """points.jsonl."""
    config: Config
    """What the points were measured with."""
    rows: dict[str, list[Row]] = field(default_factory=dict)
    """Point name → its rows."""

    def open(self) -> None:
        """Read what an earlier run left; begin anew if there is nothing.

        Raises
        ------
        InputError
            If the file is of another configuration, or its folder cannot be written.
        """
        head = json.dumps({name: value for name, value in asdict(self.config).items() if name in _KEPT})
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            if not self.path.exists():
                self.path.write_text(head + "\n", encoding="utf-8")
            first, *lines = self.path.read_text(encoding="utf-8").splitlines() or [""]
        except OSError as error:
            raise InputError(f"{self.path}: expected a file that can be written: {error.strerror}") from error
        if first != head:
            raise InputError(f"{self.path}: expected a run of {head}, found one of {first}; give another --out")
        for line in lines:
            try:
                entry = json.loads(line)
            except json.JSONDecodeError:
                continue  # a run that was killed while writing leaves half a line
            self.rows[entry["point"]] = entry["rows"]

    def add(self, name: str, rows: list[Row]) -> None:
        """Keep one finished point."""
        self.rows[name] = rows
        with self.path.open("a", encoding="utf-8") as file:
            file.write("\n" * _ends_amid_a_line(self.path) + json.dumps({"point": name, "rows": rows}) + "\n")


def _ends_amid_a_line(path: Path) -> bool:
    with path.open("rb") as file:
        file.seek(-1, os.SEEK_END)
        return file.read(1) != b"\n"
