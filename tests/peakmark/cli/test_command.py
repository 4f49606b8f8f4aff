"""What every command shares: exit statuses, errors as one line; and every script is a command with its help."""

import os
import runpy
import shlex
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from peakmark.cli.app import COMMANDS, load_command
from peakmark.cli.command import one_line, plain_app, run_command
from peakmark.errors import ImageError, InputError, RendererError
from tests.places import ROOT, SOURCES

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


def all_commands() -> Iterator[tuple[str, Any]]:
    """Yield how each command is called, and the command."""
    for name in COMMANDS:
        command = load_command(name)
        if hasattr(command, "commands"):
            yield from ((f"peakmark {name} {part}", one) for part, one in command.commands.items())
        else:
            yield f"peakmark {name}", command
    for script in SCRIPTS:
        (function,) = (v for k, v in runpy.run_path(str(script)).items() if k not in ("run_command",) and callable(v))
        if not isinstance(function, typer.Typer) and script.stem != "make_corpus":  # which is `peakmark corpus make`
            app = plain_app()
            app.command()(function)
            yield f"python scripts/{script.name}", typer.main.get_command(app)


@pytest.mark.parametrize(("call", "command"), [pytest.param(*one, id=one[0]) for one in all_commands()])
def test_every_help_has_two_examples_that_parse_and_no_noise(call: str, command: Any) -> None:
    shown = command.get_help(command.make_context(call, [], resilient_parsing=True))
    lines = [line.strip() for line in shown.split("Examples:\n")[1].split("\n\n")[0].splitlines()]
    assert len(lines) == 2
    for line in lines:
        assert line.startswith(call)
        command.make_context(call, shlex.split(line.removeprefix(call)))  # raises for an unknown option
    assert "<bool>" not in shown
    assert "nothing here is random" not in shown
    seeds = [option for option in command.params if option.name == "seed"]
    assert all(option.hidden == ("nothing here is random" in option.help) for option in seeds)
    if seeds:
        command.make_context(call, [*shlex.split(lines[0].removeprefix(call)), "--seed", "3"])


@pytest.mark.parametrize("encoding", ["latin-1", "ascii"])
def test_a_terminal_that_cannot_show_an_arrow_does_not_end_a_command(encoding: str) -> None:
    code = "from peakmark.cli.command import run_command\ndef show(): print('a → b')\nrun_command(show)"
    environment = {**os.environ, "PYTHONPATH": SOURCES, "PYTHONIOENCODING": encoding}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, check=False, env=environment, timeout=60)
    assert (done.returncode, done.stdout, done.stderr) == (0, b"a ? b\n", b"")


def test_what_steers_a_terminal_is_escaped() -> None:
    assert one_line("a\x1b[31m\n\tb\udcff → é") == "a\\x1b[31m b\\udcff → é"
