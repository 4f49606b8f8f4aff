"""Whatever ends a run, its detector, all that this started, and its temporary files end with it."""

import os
import shlex
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from time import monotonic, sleep

import pytest

from tests.peakmark.regress.helpers import make_small_corpus
from tests.peaksim.corpus.helpers import child_environment
from tests.user_detectors import STUBBORN

TOKEN = "PEAKMARK_TEST_RUN"
ENDS = {"INT": 130, "TERM": 143, "HUP": 129, "KILL": -9}


@pytest.fixture(scope="module")
def corpus(tmp_path_factory: pytest.TempPathFactory) -> str:
    return make_small_corpus(tmp_path_factory.mktemp("corpus"))


def program(folder: Path) -> str:
    """Return the name of a shell script that ignores signals, starts a program that does too, and hangs."""
    script = folder / "stubborn.sh"
    child = shlex.join([sys.executable, "-c", STUBBORN])
    script.write_text(
        f"trap '' INT TERM HUP\n{child} &\nread line\ntouch $PEAKMARK_TEST_READY\nwhile :; do sleep 60; done\n"
    )
    return f"exec:sh {script}"


def living(token: str) -> list[str]:
    """Return the command lines of the processes whose environment holds a token."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            if f"{TOKEN}={token}".encode() in (folder / "environ").read_bytes().split(b"\0"):
                found.append((folder / "cmdline").read_bytes().replace(b"\0", b" ").decode())
        except OSError:
            continue
    return found


def wait_until(is_so: Callable[[], object], limit_s: float) -> bool:
    end = monotonic() + limit_s
    while not is_so() and monotonic() < end:
        sleep(0.05)
    return bool(is_so())


def start(tmp_path: Path, corpus: str, detector: str, workers: int) -> "subprocess.Popen[str]":
    """Start a run and wait until its detector hangs."""
    (tmp_path / "tmp").mkdir(exist_ok=True)
    ready = tmp_path / "ready"
    added = {TOKEN: str(tmp_path), "PEAKMARK_TEST_READY": str(ready), "TMPDIR": str(tmp_path / "tmp")}
    options = ["--detector", detector, "--workers", str(workers), "--out", str(tmp_path / "out")]
    run = subprocess.Popen(
        [sys.executable, "-m", "peakmark.cli", "regress", "run", corpus, *options],
        env={**os.environ, **child_environment(), **added},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert wait_until(ready.exists, 60)
    return run


@pytest.mark.parametrize(
    ("kind", "end", "workers"),
    [
        ("function", "INT", 2),
        ("function", "TERM", 2),
        pytest.param("function", "HUP", 1, marks=pytest.mark.slow),
        ("function", "KILL", 2),
        pytest.param("program", "TERM", 1, marks=pytest.mark.slow),
        ("program", "KILL", 1),
        pytest.param("program", "INT", 1, marks=pytest.mark.slow),
    ],
)
def test_nothing_outlives_a_run(tmp_path: Path, corpus: str, kind: str, end: str, workers: int) -> None:
    detector = program(tmp_path) if kind == "program" else "tests.user_detectors:stubborn"
    run = start(tmp_path, corpus, detector, workers)
    assert len(living(str(tmp_path))) >= 4  # run, watcher, detector, its children
    os.kill(run.pid, getattr(signal, f"SIG{end}"))
    assert run.wait(15) == ENDS[end]
    assert wait_until(lambda: not living(str(tmp_path)), 5), living(str(tmp_path))
    assert run.stderr is not None
    assert "Traceback" not in run.stderr.read()
    assert wait_until(lambda: not list((tmp_path / "tmp").glob("peakmark-*")), 5)
    if end == "KILL":
        assert [path.name[:12] for path in (tmp_path / "out").iterdir()] == [".unfinished-"]  # the next run's to remove
    else:
        assert not (tmp_path / "out").exists()
