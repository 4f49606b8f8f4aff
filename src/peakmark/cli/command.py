"""What every command shares: errors as one line, exit statuses, and a clean end however it comes.

| status | meaning |
|---|---|
| 0 | done |
| 1 | `regress compare`: something got worse or changed; `corpus check`: files are not as they were written |
| 2 | bad input |
| 3 | the renderer failed |
| 4 | a fault of this program, with a traceback |
| 129, 130, 143 | ended by SIGHUP, SIGINT (Ctrl-C), SIGTERM |
"""

import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import current_thread, main_thread
from typing import Any, NoReturn

import typer

from peakmark.errors import InputError, RendererError, one_line


def run_command(command: Callable[..., Any]) -> NoReturn:
    """Run a function of typed arguments, or a Typer app, as a program."""
    try:
        with _cleaning_up_when_told_to_end():
            if isinstance(command, typer.Typer):
                command()
            else:
                typer.run(command)
    except InputError as error:
        _stop(error, 2)
    except RendererError as error:
        _stop(error, 3)
    except Exception:
        sys.excepthook(*sys.exc_info())
        sys.exit(4)
    sys.exit(0)


def _stop(reason: object, status: int) -> NoReturn:
    print("error:", one_line(str(reason)), file=sys.stderr)
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
        for number in (signal.SIGTERM, signal.SIGHUP):
            if signal.getsignal(number) is not signal.SIG_IGN:  # as nohup asks for
                before[number] = signal.signal(number, leave)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
