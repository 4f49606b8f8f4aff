"""A detector in a process of its own, which is stopped when it takes too long and started again when it has died."""

import json
import os
import select
import shlex
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from time import monotonic
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from peakmark.errors import InputError
from peakmark.regress.detector_protocol import DetectorFailure, Found, parse_answer, request_line

_LONGEST_LINE = 200_000_000  # bytes: room for `MOST_POINTS` points of 200 characters


@contextmanager
def open_process(
    name: str, parameters: dict[str, Any], time_limit_s: float, start_limit_s: float
) -> Iterator["DetectorProcess"]:
    """Give a detector that runs "exec:PROGRAM …", "module:function" or "cv2:NAME".

    `start_limit_s` is for its start, and once more on top of `time_limit_s` for the first image.

    Raises
    ------
    InputError
        If it cannot be started.
    """
    with tempfile.TemporaryDirectory(prefix="peakmark-") as folder:
        detector = DetectorProcess(name, command_of(name, parameters), (time_limit_s, start_limit_s), Path(folder))
        try:
            detector.start()
            yield detector
        finally:
            detector.stop()


class DetectorProcess:
    """A program and the pipes to it; calling it with an image asks for an answer."""

    def __init__(self, name: str, command: list[str], limits_s: tuple[float, float], folder: Path) -> None:
        self.name = name
        self._command = command
        self._time_limit_s, self._start_limit_s = limits_s
        self._is_warm = False
        self._folder = folder
        self._errors = folder / "stderr.txt"
        self._process: subprocess.Popen[bytes] | None = None
        self._pending = b""
        self._frame = 0

    def __call__(self, image: NDArray[np.uint8]) -> Found:
        """Return what the program finds in a (H, W) grey image.

        Raises
        ------
        DetectorFailure
            "timeout: …", "crash: …", "rubbish: …" or "error: …"; the next image gets a new process.
        """
        frame, self._frame = self._frame, self._frame + 1
        file = self._folder / f"{frame:08d}.png"
        cv2.imwrite(str(file), image, [cv2.IMWRITE_PNG_COMPRESSION, 1])
        try:
            self.start()
            found = parse_answer(self._ask(request_line(frame, str(file), image.shape[1], image.shape[0])), frame)
            self._is_warm = True
            return found
        except DetectorFailure as failure:
            if not str(failure).startswith("error:"):
                self.stop()  # whatever it still writes must not be taken for the next answer
            raise
        finally:
            file.unlink()

    def start(self) -> None:
        """Start the program unless it runs.

        Raises
        ------
        InputError
            If it cannot be started.
        """
        if self._process is not None:
            return
        try:
            with self._errors.open("wb") as errors:
                self._process = subprocess.Popen(
                    self._command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=errors, start_new_session=True
                )
        except OSError as error:
            reason = f"{self._command[0]}: cannot be started: {error.strerror}"
            raise InputError(f"detector {self.name}: {reason}") from error
        if not self.name.startswith("exec:"):
            self._await_ready()

    def _await_ready(self) -> None:
        """Wait until our host of a user's function has imported it."""
        try:
            line = self._read_line(self._start_limit_s)
        except DetectorFailure as failure:
            raise InputError(f"detector {self.name}: cannot be started: {failure}") from failure
        if line != b"ready\n":
            raise InputError(f"detector {self.name}: {line.decode('utf-8', 'replace').strip()[:300]}")

    def stop(self) -> None:
        """End the program and all that it started."""
        if self._process is None:
            return
        with suppress(ProcessLookupError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            assert pipe is not None
            with suppress(BrokenPipeError):
                pipe.close()
        self._process, self._pending, self._is_warm = None, b"", False

    def _ask(self, line: bytes) -> bytes:
        assert self._process is not None
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(line)
            self._process.stdin.flush()
        except BrokenPipeError as error:
            raise self._crash() from error
        return self._read_line(self._time_limit_s + (0.0 if self._is_warm else self._start_limit_s))

    def _read_line(self, limit_s: float) -> bytes:
        assert self._process is not None
        assert self._process.stdout is not None
        handle, deadline = self._process.stdout.fileno(), monotonic() + limit_s
        while b"\n" not in self._pending:
            if not select.select([handle], [], [], max(0.0, deadline - monotonic()))[0]:
                raise DetectorFailure(f"timeout: no answer within {limit_s:g} s")
            chunk = os.read(handle, 1 << 20)
            if not chunk:
                raise self._crash()
            self._pending += chunk
            if len(self._pending) > _LONGEST_LINE:
                raise DetectorFailure(f"rubbish: a line longer than {_LONGEST_LINE} bytes")
        line, _, self._pending = self._pending.partition(b"\n")
        return line + b"\n"

    def _crash(self) -> DetectorFailure:
        """Return how the program ended, with the last line of its complaints."""
        assert self._process is not None
        try:
            status = self._process.wait(1.0)
        except subprocess.TimeoutExpired:
            return DetectorFailure("crash: it closed its output")
        words = self._errors.read_text("utf-8", "replace").strip().splitlines()
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
    if not command:
        raise InputError(f"detector {name}: expected exec:PROGRAM ARGUMENTS, got no program")
    return command
