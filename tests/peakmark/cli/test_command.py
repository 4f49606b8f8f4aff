"""What every command shares: exit statuses, errors as one line; and every script is a command with its help."""

import runpy
from collections.abc import Callable
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from peakmark.cli.command import run_command
from peakmark.errors import ImageError, InputError, RendererError
from tests.places import ROOT

SCRIPTS = sorted((ROOT / "scripts").glob("*.py"))


def raising(error: BaseException | None) -> Callable[[], None]:
    """Return a command that raises, or does nothing for None."""

    def command() -> None:
        if error is not None:
            raise error

    return command


@pytest.mark.parametrize("is_app", [False, True])
@pytest.mark.parametrize(
    ("error", "status", "words"),
    [
        (None, 0, ""),
        (InputError("expected\n  this, got that"), 2, "error: expected this, got that\n"),
        (ImageError("no image"), 2, "error: no image\n"),
        (RendererError("no context"), 3, "error: no context\n"),
        (typer.Exit(1), 1, ""),
    ],
)
def test_an_end_has_its_status_and_its_line(
    error: BaseException | None,
    status: int,
    words: str,
    is_app: bool,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    app = typer.Typer()
    app.command()(raising(error))
    monkeypatch.setattr("sys.argv", ["peakmark"])
    with pytest.raises(SystemExit) as ended:
        run_command(app if is_app else raising(error))
    assert ended.value.code == status
    assert capsys.readouterr().err == words


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_every_script_is_a_command_with_its_options(script: Path) -> None:
    (command,) = (v for k, v in runpy.run_path(str(script)).items() if k not in ("run_command",) and callable(v))
    app = command if isinstance(command, typer.Typer) else typer.Typer()
    if command is not app:
        app.command()(command)
    names = ["run"] if command is app else []
    done = CliRunner().invoke(app, [*names, "--help"])
    assert done.exit_code == 0, done.output
    assert all(f"--{name} " in done.output for name in ("out", "seed", "quiet"))
