"""What every command shares: exit statuses, errors as one line; and every script is a command with its help."""

import os
import runpy
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from peakmark.cli.app import COMMANDS, load_command
from peakmark.cli.command import plain_app, resumable, run_command
from peakmark.cli.corpus import make
from peakmark.errors import ImageError, InputError, NativeError, RendererError, one_line
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
        (InputError("a \x1b[31mred\x07 \u202etxt"), 2, "error: a \\x1b[31mred\\x07 \\u202etxt\n"),
        (NativeError("no library"), 2, "error: no library\n"),
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
            time.sleep(10)
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
    taker: Any = typer.main.get_command(app)
    taker = taker.commands["run"] if command is app else taker
    assert {"--out", "--seed", "--quiet"} <= {option for parameter in taker.params for option in parameter.opts}


def all_commands() -> Iterator[tuple[str, Any]]:
    """Yield how each command is called, and the command; scripts that call a command of the program are left out."""
    of_the_program = {id(make)}
    for name in COMMANDS:
        command = load_command(name)
        module, _, attribute = COMMANDS[name][0].partition(":")
        of_the_program.add(id(getattr(import_module(module), attribute)))
        if hasattr(command, "commands"):
            yield from ((f"peakmark {name} {part}", one) for part, one in command.commands.items())
        else:
            yield f"peakmark {name}", command
    for script in SCRIPTS:
        (function,) = (v for k, v in runpy.run_path(str(script)).items() if k not in ("run_command",) and callable(v))
        if not isinstance(function, typer.Typer) and id(function) not in of_the_program:
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


def test_a_command_that_resumes_says_so_on_ctrl_c(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def command() -> None:
        with resumable("the same command with --resume resumes"):
            raise KeyboardInterrupt

    monkeypatch.setattr("sys.argv", ["peakmark"])
    with pytest.raises(SystemExit) as ended:
        run_command(command)
    assert ended.value.code == 130
    assert capsys.readouterr().err == "interrupted: the same command with --resume resumes\n"


def test_a_real_command_that_is_interrupted_resumes(tmp_path: Path) -> None:
    command = [sys.executable, str(ROOT / "scripts" / "evaluate_cave.py"), "--rooms", "50", "--views", "1"]
    command += ["--size", "0.2", "--workers", "1", "--out", str(tmp_path / "out")]
    environment = {**os.environ, "PYTHONPATH": SOURCES}
    with subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, env=environment
    ) as run:
        journal = tmp_path / "out" / "journal.jsonl"
        for _ in range(3000):
            if run.poll() is not None or (journal.exists() and len(journal.read_text().splitlines()) > 1):
                break
            time.sleep(0.1)
        run.send_signal(signal.SIGINT)
        _, said = run.communicate(timeout=60)
    assert run.returncode == 130
    assert said.splitlines()[-1] == "interrupted: the same command resumes"
    assert len(journal.read_text().splitlines()) > 1
