"""Runs commands and scripts in this process, as a user's shell would."""

import runpy
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from io import StringIO
from pathlib import Path

import pytest

from peakmark.cli.app import app
from peakmark.cli.command import run_command
from tests.places import ROOT


@dataclass(frozen=True)
class Done:
    """What a command left: exit status and both streams."""

    returncode: int
    stdout: str
    stderr: str


Run = Callable[..., Done]


def runner(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], script: str | None = None
) -> Run:
    """Return what runs `peakmark ARGUMENTS`, or a script of that name, in a folder."""
    path = ROOT / "scripts" / (script or "")
    call = partial(runpy.run_path, str(path), run_name="__main__") if script else partial(run_command, app)
    monkeypatch.chdir(folder)
    monkeypatch.setenv("COLUMNS", "120")

    def run(*arguments: object, stdin: str = "") -> Done:
        monkeypatch.setattr("sys.argv", ["peakmark", *map(str, arguments)])
        monkeypatch.setattr("sys.stdin", StringIO(stdin))
        with pytest.raises(SystemExit) as ended:
            call()
        shown = capfd.readouterr()
        return Done(int(str(ended.value.code)), shown.out, shown.err)

    return run
