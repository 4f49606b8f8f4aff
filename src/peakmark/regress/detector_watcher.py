"""The process between a run and a detector: it ends the detector and all that it started, whatever ends the run.

`python -I -S detector_watcher.py CONTROL TEMPORARY PROGRAM ARGUMENTS …`. CONTROL is an inherited socket: the watcher
answers "+FOLDER" (a new folder in TEMPORARY for the detector's images) or "-REASON", and then each byte with the
program's exit status, or with an empty line while it runs. When the other end closes, which the kernel does for a run
that is killed, every process below this one is asked to end, killed a second later, and the folder deleted.
"""

import ctypes
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
from contextlib import suppress
from pathlib import Path
from time import monotonic, sleep

_GRACE_S = 1.0  # between SIGTERM and SIGKILL; also for a program that closes its output before it ends
_KILL_LIMIT_S = 5.0  # a process that the kernel does not end, such as one waiting for a dead disk, is given up
_STEP_S = 0.01

_PR_SET_PDEATHSIG = 1  # linux/prctl.h
_PR_SET_CHILD_SUBREAPER = 36  # orphans of the detector become children of this process


def main(control_fd: str, temporary: str, *command: str) -> None:
    """Run a program until it and the run have ended."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda *_: None)  # the run decides; an ignored signal would be so for the program too
    control = socket.socket(fileno=int(control_fd))
    _prctl(_PR_SET_CHILD_SUBREAPER, 1)
    folder = None
    try:
        folder = tempfile.mkdtemp(prefix="peakmark-", dir=temporary)
        process = subprocess.Popen(command, start_new_session=True, preexec_fn=_end_with_watcher)
        _forget_streams()
        control.sendall(f"+{folder}\n".encode())
        while control.recv(1):
            control.sendall(f"{_status(process)}\n".encode())
    except ConnectionError:
        pass  # the run has ended
    except OSError as error:
        control.sendall(f"-{error.strerror or error}\n".encode())
    finally:
        end_descendants()
        if folder is not None:
            shutil.rmtree(folder, ignore_errors=True)


def _end_with_watcher() -> None:
    _prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


def _prctl(option: int, value: int) -> None:
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(option, value)


def _forget_streams() -> None:
    """Leave the pipes to the program alone, so that they end when it does."""
    null = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(null, stream)


def _status(process: "subprocess.Popen[bytes]") -> str:
    with suppress(subprocess.TimeoutExpired):
        return str(process.wait(_GRACE_S))
    return ""


def end_descendants() -> None:
    """End all processes below this one: SIGTERM, and SIGKILL after a second."""
    start = monotonic()
    _signal(_descendants(), signal.SIGTERM)
    while (living := _descendants()) and monotonic() < start + _GRACE_S + _KILL_LIMIT_S:
        if monotonic() > start + _GRACE_S:
            _signal(living, signal.SIGKILL)
        sleep(_STEP_S)


def _signal(processes: list[int], number: int) -> None:
    for process in processes:
        with suppress(OSError):
            os.kill(process, number)


def _descendants() -> list[int]:
    """Return the processes below this one, without the children that have ended and were reaped now."""
    with suppress(ChildProcessError):
        while os.waitpid(-1, os.WNOHANG)[0]:
            pass
    children: dict[int, list[int]] = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            parent = stat.read_bytes().rpartition(b")")[2].split()[1]  # after the name, which may hold anything
            children.setdefault(int(parent), []).append(int(stat.parent.name))
    found = children.get(os.getpid(), [])
    for process in found:
        found += children.get(process, [])
    return found


if __name__ == "__main__":
    main(*sys.argv[1:])
