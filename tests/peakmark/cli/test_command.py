"""What every command shares: exit statuses, errors as one line; and every script is a command with its help."""

import runpy
import signal
from collections.abc import Callable
from pathlib import Path
from time import sleep

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
        (InputError("a \x1b[31mred\x07 \u202etxt"), 2, "error: a \\x1b[31mred\\x07 \\u202etxt\n"),
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


def test_a_fault_of_our_own_is_told_whole_and_is_no_regression(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.argv", ["peakmark"])
    with pytest.raises(SystemExit) as ended:
        run_command(raising(ZeroDivisionError("by zero")))
    assert ended.value.code == 4
    assert "by zero" in capsys.readouterr().err


@pytest.mark.parametrize(("number", "status"), [(signal.SIGTERM, 143), (signal.SIGHUP, 129), (signal.SIGINT, 130)])
def test_a_signal_leaves_through_what_cleans_up(
    number: signal.Signals, status: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    cleaned = []

    def command() -> None:
        try:
            signal.raise_signal(number)
            sleep(10)
        finally:
            if number != signal.SIGINT:
                signal.raise_signal(number)  # a second one does not interrupt
            cleaned.append(True)

    monkeypatch.setattr("sys.argv", ["peakmark"])
    before = signal.getsignal(number)
    with pytest.raises(SystemExit) as ended:
        run_command(command)
    assert ended.value.code == status
    assert cleaned == [True]
    assert signal.getsignal(number) is before


def test_under_nohup_a_hangup_is_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.argv", ["peakmark"])
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with pytest.raises(SystemExit) as ended:
            run_command(lambda: signal.raise_signal(signal.SIGHUP))
    finally:
        signal.signal(signal.SIGHUP, before)
    assert ended.value.code == 0


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
