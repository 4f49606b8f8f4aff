"""A detector in a process of its own, which is stopped when it takes too long and started again when it has died."""

import json
import os
import select
import shlex
import shutil
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from time import monotonic
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from peakmark.errors import InputError
from peakmark.regress import detector_watcher
from peakmark.regress.detector_protocol import DetectorFailure, Found, parse_answer, request_line

_LONGEST_LINE = 200_000_000  # bytes: room for `MOST_POINTS` points of 200 characters
_CHUNK = 1 << 16  # bytes: what a pipe holds
_KEPT_ERRORS = 4096  # bytes of standard error, of which the last line is told
_MOST_READS = 16  # chunks of standard error after the end: a pipe and what children still write
_STOP_LIMIT_S = 10.0  # the watcher needs at most six


@contextmanager
def open_process(
    name: str, parameters: dict[str, Any], time_limit_s: float, start_limit_s: float
) -> Iterator["DetectorProcess"]:
    """Give a detector that runs "exec:PROGRAM …", "module:function" or "cv2:NAME".

    `start_limit_s` is for its start, and once more on top of `time_limit_s` for its first image.

    Raises
    ------
    InputError
        If it cannot be started.
    """
    detector = DetectorProcess(name, command_of(name, parameters), (time_limit_s, start_limit_s))
    try:
        detector.start()
        yield detector
    finally:
        detector.stop()


@dataclass
class _Running:
    """A program that runs under a watcher, see `detector_watcher`."""

    watcher: "subprocess.Popen[bytes]"
    """Its streams are the program's."""
    control: socket.socket
    """To the watcher; closing it ends the program and all that it started."""
    folder: Path
    """For images; the watcher deletes it."""
    output: bytearray = field(default_factory=bytearray)
    """What was read and belongs to no answer yet."""
    errors: bytes = b""
    """The end of what was read from standard error."""
    has_errors: bool = True
    """Whether standard error is open."""
    has_answered: bool = False
    """Whether it needs no time to warm up any more."""


class DetectorProcess:
    """A program and the pipes to it; calling it with an image asks for an answer."""

    def __init__(self, name: str, command: list[str], limits_s: tuple[float, float]) -> None:
        self.name = name
        self._command = command
        self._time_limit_s, self._start_limit_s = limits_s
        self._running: _Running | None = None
        self._may_warm_up = True
        self._frame = 0

    def __call__(self, image: NDArray[np.uint8]) -> Found:
        """Return what the program finds in a (H, W) grey image.

        Raises
        ------
        DetectorFailure
            "timeout: …", "crash: …", "rubbish: …" or "error: …"; the next image gets a new process.
        InputError
            If the program cannot be started again, or the image not be written for it.
        """
        frame, self._frame = self._frame, self._frame + 1
        running = self.start()
        file = _write_image(running.folder / f"{frame:08d}.png", image)
        try:
            line = request_line(frame, str(file), image.shape[1], image.shape[0])
            found = parse_answer(self._ask(running, line), frame)
            running.has_answered = self._may_warm_up = True
            return found
        except DetectorFailure as failure:
            if not str(failure).startswith("error:"):
                self.stop()  # whatever it still writes must not be taken for the next answer
            raise
        finally:
            with suppress(OSError):  # the program may do with its image what it likes
                file.unlink()

    def start(self) -> _Running:
        """Start the program unless it runs.

        Raises
        ------
        InputError
            If it cannot be started.
        """
        if self._running is not None:
            return self._running
        try:
            self._running = _start(self._command, self._start_limit_s)
        except (DetectorFailure, OSError) as error:
            raise InputError(f"detector {self.name}: {self._command[0]}: cannot be started: {error}") from error
        if not self.name.startswith("exec:"):
            self._await_ready(self._running)
        return self._running

    def _await_ready(self, running: _Running) -> None:
        """Wait until our host of a user's function has imported it."""
        try:
            line = _read_line(running, self._start_limit_s)
        except DetectorFailure as failure:
            raise InputError(f"detector {self.name}: cannot be started: {failure}") from failure
        if line != b"ready\n":
            raise InputError(f"detector {self.name}: {line.decode('utf-8', 'replace').strip()[:300]}")

    def stop(self) -> None:
        """End the program and all that it started."""
        running, self._running = self._running, None
        if running is not None:
            _stop(running.watcher, running.control)
            shutil.rmtree(running.folder, ignore_errors=True)  # where somebody killed the watcher

    def _ask(self, running: _Running, line: bytes) -> bytes:
        """Return the answer to a request; the time to warm up is not granted again to one who used it up in vain."""
        limit_s = self._time_limit_s
        if self._may_warm_up and not running.has_answered:
            limit_s, self._may_warm_up = limit_s + self._start_limit_s, False
        assert running.watcher.stdin is not None
        try:
            os.write(running.watcher.stdin.fileno(), line)  # whole or not at all: it is shorter than PIPE_BUF
        except BrokenPipeError as error:
            raise _crash(running) from error
        except BlockingIOError as error:
            raise DetectorFailure("timeout: it does not read its requests") from error
        return _read_line(running, limit_s)


def _write_image(file: Path, image: NDArray[np.uint8]) -> Path:
    try:
        file.parent.mkdir(exist_ok=True)  # a program may have deleted it
        file.write_bytes(cv2.imencode(".png", image, [cv2.IMWRITE_PNG_COMPRESSION, 1])[1].tobytes())
    except OSError as error:
        raise InputError(f"{file}: the detector's image cannot be written: {error.strerror or error}") from error
    return file


def _start(command: list[str], limit_s: float) -> _Running:
    """Start a program under a watcher.

    Raises
    ------
    DetectorFailure, OSError
        If it cannot be started.
    """
    control, theirs = socket.socketpair()
    with theirs:
        words = [sys.executable, "-I", "-S", detector_watcher.__file__, str(theirs.fileno()), tempfile.gettempdir()]
        watcher = subprocess.Popen(
            [*words, *command],
            bufsize=0,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            start_new_session=True,
            pass_fds=[theirs.fileno()],
        )
    try:
        control.settimeout(limit_s)
        answer = _control_line(control)
        if not answer.startswith("+"):
            raise DetectorFailure(answer.removeprefix("-") or "its watcher ended")
        assert watcher.stdin is not None
        os.set_blocking(watcher.stdin.fileno(), False)
        return _Running(watcher, control, Path(answer.removeprefix("+")))
    except BaseException:
        _stop(watcher, control)
        raise


def _stop(watcher: "subprocess.Popen[bytes]", control: socket.socket) -> None:
    """Have a watcher end everything below it."""
    for stream in (control, watcher.stdin, watcher.stdout, watcher.stderr):
        assert stream is not None
        stream.close()
    try:
        watcher.wait(_STOP_LIMIT_S)
    except subprocess.TimeoutExpired:
        watcher.kill()  # which kills the program, too
        watcher.wait()


def _control_line(control: socket.socket) -> str:
    """Return a line of the watcher; empty if it has ended."""
    line = b""
    with suppress(ConnectionError):
        while not line.endswith(b"\n") and (byte := control.recv(1)):
            line += byte
    return line.decode("utf-8", "surrogateescape").removesuffix("\n")


def _read_line(running: _Running, limit_s: float) -> bytes:
    """Return the next line of a program's output; whatever flows, within the limit."""
    deadline, searched = monotonic() + limit_s, 0
    while (end := running.output.find(b"\n", searched)) < 0:
        searched = len(running.output)
        if searched > _LONGEST_LINE:
            raise DetectorFailure(f"rubbish: a line longer than {_LONGEST_LINE} bytes")
        remaining_s = deadline - monotonic()
        if remaining_s <= 0 or not _read_some(running, remaining_s):
            raise DetectorFailure(f"timeout: no answer within {limit_s:g} s")
    line = bytes(running.output[: end + 1])
    del running.output[: end + 1]
    return line


def _read_some(running: _Running, limit_s: float) -> bool:
    """Read what a program writes next, and return whether it did within the limit."""
    output, errors = running.watcher.stdout, running.watcher.stderr
    assert output is not None
    assert errors is not None
    ready = select.select([output, errors] if running.has_errors else [output], [], [], limit_s)[0]
    if errors in ready:
        _read_errors(running)
    if output in ready:
        chunk = os.read(output.fileno(), _CHUNK)
        if not chunk:
            raise _crash(running)
        running.output += chunk
    return bool(ready)


def _read_errors(running: _Running) -> None:
    assert running.watcher.stderr is not None
    chunk = os.read(running.watcher.stderr.fileno(), _CHUNK)
    running.has_errors = bool(chunk)
    running.errors = (running.errors + chunk)[-_KEPT_ERRORS:]


def _crash(running: _Running) -> DetectorFailure:
    """Return how the program ended, with the last line of its complaints."""
    with suppress(ConnectionError):
        running.control.sendall(b"?")
    status = _control_line(running.control)
    if not status:
        return DetectorFailure("crash: it closed its output")
    assert running.watcher.stderr is not None
    for _ in range(_MOST_READS):
        if running.has_errors and select.select([running.watcher.stderr], [], [], 0)[0]:
            _read_errors(running)
    words = running.errors.decode("utf-8", "replace").strip().splitlines()
    return DetectorFailure(f"crash: it ended with status {status}{': ' + words[-1][:200] if words else ''}")


def command_of(name: str, parameters: dict[str, Any]) -> list[str]:
    """Return the program and arguments of a detector's name.

    Raises
    ------
    InputError
        If it names no program.
    """
    if not name.startswith("exec:"):
        return [sys.executable, "-m", "peakmark.regress.detector_host", name, json.dumps(parameters)]
    try:
        command = shlex.split(name.removeprefix("exec:"))
    except ValueError as error:
        raise InputError(f"detector {name}: expected exec:PROGRAM ARGUMENTS: {error}") from error
    if parameters:
        given = ", ".join(parameters)
        raise InputError(f"detector {name}: expected no parameters but its own ARGUMENTS, got {given}")
    if not command:
        raise InputError(f"detector {name}: expected exec:PROGRAM ARGUMENTS, got no program")
    return command
