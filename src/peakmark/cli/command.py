"""What every command shares: errors as one line, exit statuses, and a clean end however it comes.

| status | meaning |
|---|---|
| 0 | done |
| 1 | `regress compare`: something got worse or changed; `corpus check`: files are not as they were written |
| 2 | bad input, a library that is not installed, or compiled kernels that cannot be used |
| 3 | the renderer failed |
| 4 | a fault of this program, with a traceback |
| 129, 130, 143 | ended by SIGHUP, SIGINT (Ctrl-C), SIGTERM |
"""

import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from inspect import cleandoc
from io import TextIOWrapper
from threading import current_thread, main_thread
from typing import Any, NoReturn, TypeVar

import typer
from peaksim.extras import how_to_install

from peakmark.errors import InputError, NativeError, RendererError, one_line

Command = TypeVar("Command", bound=Callable[..., Any])
_ENDING = (signal.SIGTERM,) if sys.platform == "win32" else (signal.SIGTERM, signal.SIGHUP)


def plain_app(**settings: Any) -> typer.Typer:
    """Return a Typer app whose help is plain text: Rich would take [brackets] for markup, and switches for <bool>."""
    return typer.Typer(**{"add_completion": False, "rich_markup_mode": None, **settings})


def examples(*lines: str) -> Callable[[Command], Command]:
    """Return a decorator that ends a command's help with example calls."""

    def add(command: Command) -> Command:
        shown = ["\b", "Examples:", *(f"  {line}" for line in lines)]  # \b keeps the paragraph's lines as they are
        command.__doc__ = "\n".join([cleandoc(command.__doc__ or ""), "", *shown])
        return command

    return add


def run_command(command: Callable[..., Any]) -> NoReturn:
    """Run a function of typed arguments, or a Typer app, as a program."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal of another encoding shows ? for →
    try:
        with _cleaning_up_when_told_to_end():
            if isinstance(command, typer.Typer):
                command()
            else:
                app = plain_app()
                app.command()(command)
                app()
    except (InputError, NativeError) as error:
        _stop(error, 2)
    except RendererError as error:
        _stop(error, 3)
    except Exception as error:
        missing = how_to_install(error) if isinstance(error, ModuleNotFoundError) else None
        if missing:
            _stop(missing, 2)
        sys.excepthook(*sys.exc_info())
        sys.exit(4)
    sys.exit(0)


@contextmanager
def resumable(how: str = "the same command resumes") -> Iterator[None]:
    """Say on Ctrl-C how the interrupted command resumes."""
    try:
        yield
    except KeyboardInterrupt:
        print(f"interrupted: {how}", file=sys.stderr)
        raise typer.Exit(128 + signal.SIGINT) from None


def print_error(reason: object) -> None:
    """Print what is wrong as one line on standard error."""
    print("error:", one_line(str(reason)), file=sys.stderr)


def _stop(reason: object, status: int) -> NoReturn:
    print_error(reason)
    sys.exit(status)


@contextmanager
def _cleaning_up_when_told_to_end() -> Iterator[None]:
    """Let SIGTERM and SIGHUP leave through every `finally`, as Ctrl-C does, instead of ending the process at once."""

    def leave(number: int, _: object) -> None:
        for other in before:
            signal.signal(other, lambda *_: None)  # cleaning up is not interrupted by being told again
        sys.exit(128 + number)

    before = {}
    if current_thread() is main_thread():
        for number in _ENDING:
            if signal.getsignal(number) is not signal.SIG_IGN:  # as nohup asks for
                before[number] = signal.signal(number, leave)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
