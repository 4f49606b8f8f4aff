"""What workers do in tests of backends: each imports this file alone, and nothing heavy with it."""

import ctypes
import os
import signal
from pathlib import Path

from peaksim.errors import InputError


def square(number: int) -> int:
    return number * number


def die_once(folder: str, number: int) -> int:
    """Kill its own process the first time that number 3 comes."""
    mark = Path(folder) / "died"
    if number == 3 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def always_die(number: int) -> int:
    os.kill(os.getpid(), signal.SIGKILL)
    return number


def refuse(number: int) -> int:
    raise InputError(f"no {number}")


def stumble(number: int) -> int:
    return 1 // number


def hold_the_interpreter(folder: str, number: int) -> None:
    """Let no thread of this process run for a minute."""
    (Path(folder) / "pid").write_text(f"{os.getpid()} ")
    ctypes.PyDLL(None).sleep(60)


def threads(number: int) -> str:
    return ",".join(os.environ.get(name, "") for name in ("PEAKSIM_THREADS", "PEAKMARK_THREADS", "LP_NUM_THREADS"))
