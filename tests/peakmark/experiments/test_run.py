"""Running items: in order whatever the workers, nothing done twice, and a killed run resumes to the same records."""

import os
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import pytest

from peakmark.errors import InputError
from peakmark.experiments.journal import Journal
from peakmark.experiments.run import run_items
from tests.places import ROOT, SOURCES

NAMES = [f"item {k}" for k in range(12)]
PATHS = os.pathsep.join([SOURCES, str(ROOT)])


def squared(log: Path, wait_s: float, index: int) -> dict[str, int]:
    """Return a record, slowly, and say in a file of its own that it was asked for."""
    with (log / f"{index}").open("a") as file:
        file.write("x")
    time.sleep(wait_s)
    return {"index": index, "square": index * index}


def expected() -> list[dict[str, int]]:
    return [{"index": k, "square": k * k} for k in range(len(NAMES))]


@pytest.mark.parametrize("workers", [1, 3])
def test_records_come_in_the_order_of_the_items(tmp_path: Path, workers: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", PATHS)
    steps: list[tuple[int, int]] = []
    journal = Journal.open(tmp_path / "out", {})
    found = run_items(journal, NAMES, partial(squared, tmp_path, 0.0), workers, lambda *step: steps.append(step))
    assert found == expected()
    assert steps == [(done, 12) for done in range(13)]


def test_finished_items_are_not_done_again(tmp_path: Path) -> None:
    journal = Journal.open(tmp_path / "out", {})
    journal.add("item 4", {"index": 4, "square": 16})
    steps: list[tuple[int, int]] = []
    assert run_items(journal, NAMES, partial(squared, tmp_path, 0.0), 1, lambda *s: steps.append(s)) == expected()
    assert steps[0] == (1, 12)
    assert not (tmp_path / "4").exists()


def test_what_goes_wrong_leaves_the_finished_items(tmp_path: Path) -> None:
    def fails_at_five(index: int) -> int:
        if index == 5:
            raise InputError("five")
        return index

    with pytest.raises(InputError, match="five"):
        run_items(Journal.open(tmp_path, {}), NAMES, fails_at_five)
    assert list(Journal.open(tmp_path, {}).records.values()) == [0, 1, 2, 3, 4]


def test_a_number_of_workers_below_one_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="--workers: expected 1…1024, got 0"):
        run_items(Journal.open(tmp_path, {}), NAMES, abs, workers=0)


@pytest.mark.parametrize("workers", [1, 2])
def test_a_killed_run_resumes_where_it_stopped(tmp_path: Path, workers: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", PATHS)
    code = (
        "from functools import partial; from pathlib import Path; from peakmark.experiments.journal import Journal;"
        "from peakmark.experiments.run import run_items;"
        "from tests.peakmark.experiments.test_run import NAMES, squared;"
        f"log = Path({str(tmp_path)!r});"
        f"run_items(Journal.open(log / 'out', {{}}), NAMES, partial(squared, log, 0.1), {workers})"
    )
    child = subprocess.Popen([sys.executable, "-c", code])
    journal = tmp_path / "out" / "journal.jsonl"
    deadline = time.monotonic() + 60
    while not journal.exists() or len(journal.read_bytes().splitlines()) < 4:
        assert time.monotonic() < deadline
        time.sleep(0.02)
    child.send_signal(signal.SIGKILL)
    child.wait()
    kept = set(Journal.open(tmp_path / "out", {}).records)
    assert 3 <= len(kept) < 12
    assert run_items(Journal.open(tmp_path / "out", {}), NAMES, partial(squared, tmp_path, 0.0), workers) == expected()
    assert all((tmp_path / name.split()[1]).read_text() == "x" for name in kept)
