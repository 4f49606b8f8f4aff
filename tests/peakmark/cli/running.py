"""Runs commands in this process, as a user's shell would."""

from collections.abc import Callable
from dataclasses import dataclass
from io import StringIO
from pathlib import Path

import pytest

from peakmark.cli.app import app
from peakmark.cli.command import run_command


@dataclass(frozen=True)
class Done:
    """What a command left: exit status and both streams."""

    returncode: int
    stdout: str
    stderr: str


Run = Callable[..., Done]


def runner(folder: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Run:
    """Return what runs `peakmark ARGUMENTS` in a folder."""
    monkeypatch.chdir(folder)
    monkeypatch.setenv("COLUMNS", "120")

    def run(*arguments: object, stdin: str = "") -> Done:
        monkeypatch.setattr("sys.argv", ["peakmark", *map(str, arguments)])
        monkeypatch.setattr("sys.stdin", StringIO(stdin))
        with pytest.raises(SystemExit) as ended:
            run_command(app)
        shown = capfd.readouterr()
        return Done(int(str(ended.value.code)), shown.out, shown.err)

    return run
