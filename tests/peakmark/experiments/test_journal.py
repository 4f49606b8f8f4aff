"""Journals: what is added is there when opened again; torn lines, other configurations and other files."""

import json
import os
import tracemalloc
from pathlib import Path

import pytest

from peakmark.errors import InputError
from peakmark.experiments.floor.flight import FlightConfig
from peakmark.experiments.journal import Journal, journal_key
from peakmark.experiments.robot.drive import DriveConfig

SETTINGS = {"seed": 3, "sides": (1.5, 2.0), "extra": None}


def test_what_was_added_is_there_again(tmp_path: Path) -> None:
    journal = Journal.open(tmp_path / "out", SETTINGS)
    journal.add("room/1 — a", [{"x": 1.25, "y": None}])
    journal.add("2", {"text": "two\nlines"})
    again = Journal.open(tmp_path / "out", SETTINGS)
    assert again.records == {"room/1 — a": [{"x": 1.25, "y": None}], "2": {"text": "two\nlines"}}
    assert again.records == journal.records


def test_records_stay_on_disk(tmp_path: Path) -> None:
    journal = Journal.open(tmp_path, SETTINGS)
    tracemalloc.start()
    for number in range(1000):
        journal.add(f"{number}", {"text": f"{number}" * 2000})
    again = Journal.open(tmp_path, SETTINGS)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 1e6 < journal.path.stat().st_size
    assert again.records["700"] == journal.records["700"] == {"text": "700" * 2000}


def test_a_run_that_is_not_to_be_resumed_begins_anew(tmp_path: Path) -> None:
    Journal.open(tmp_path, SETTINGS).add("1", 1)
    Journal.open(tmp_path, SETTINGS).file("1.jpg").write_bytes(b"")
    other = Journal.open(tmp_path, {"seed": 4}, is_resumed=False)
    assert other.records == {}
    assert [path.name for path in tmp_path.iterdir()] == ["journal.jsonl"]


@pytest.mark.parametrize("cut", range(1, 60, 7))
def test_a_line_torn_by_a_kill_is_forgotten_and_the_next_one_kept(tmp_path: Path, cut: int) -> None:
    journal = Journal.open(tmp_path, SETTINGS)
    journal.add("whole", 1)
    size = journal.path.stat().st_size
    journal.add("torn", {"text": "x" * 60})
    os.truncate(journal.path, size + cut)
    resumed = Journal.open(tmp_path, SETTINGS)
    assert resumed.records == {"whole": 1}
    resumed.add("next", 2)
    assert Journal.open(tmp_path, SETTINGS).records == {"whole": 1, "next": 2}


def test_another_configuration_is_named_and_nothing_is_lost(tmp_path: Path) -> None:
    Journal.open(tmp_path, SETTINGS).add("1", 1)
    with pytest.raises(InputError, match=r"journal\.jsonl: holds a run of another configuration: seed was 3, is 4"):
        Journal.open(tmp_path, {**SETTINGS, "seed": 4})
    assert Journal.open(tmp_path, SETTINGS).records == {"1": 1}


@pytest.mark.parametrize("content", ["", "{", "[1]\n", "null\n", '{"seed": 3\n{"item": "1", "record": 1}\n'])
def test_a_damaged_first_line_is_refused(tmp_path: Path, content: str) -> None:
    (tmp_path / "journal.jsonl").write_text(content)
    with pytest.raises(InputError, match=r"journal\.jsonl: (is damaged|holds a run of another configuration)"):
        Journal.open(tmp_path, SETTINGS)


def test_lines_that_are_no_items_are_passed_over(tmp_path: Path) -> None:
    journal = Journal.open(tmp_path, SETTINGS)
    with journal.path.open("a") as file:
        file.writelines(json.dumps(value) + "\n" for value in (7, None, {"item": "a"}, {"item": "b", "record": 2}))
    assert Journal.open(tmp_path, SETTINGS).records == {"b": 2}


def test_files_lie_beside_the_journal_and_go_with_it(tmp_path: Path) -> None:
    journal = Journal.open(tmp_path, SETTINGS)
    journal.file("1.jpg").write_bytes(b"picture")
    assert (tmp_path / "journal" / "1.jpg").read_bytes() == b"picture"
    journal.add("1", 1)
    journal.remove_files()
    assert [path.name for path in tmp_path.iterdir()] == ["journal.jsonl"]
    assert journal.records == {"1": 1}
    journal.remove()
    assert list(tmp_path.iterdir()) == []
    assert journal.records == {}


def test_a_folder_that_cannot_be_one_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match=r"--out .*file: expected a folder that can be written"):
        Journal.open(tmp_path / "file", SETTINGS)


@pytest.mark.parametrize("kind", [FlightConfig, DriveConfig])
def test_journals_from_before_the_traced_renderer_still_fit(kind: type[FlightConfig] | type[DriveConfig]) -> None:
    plain, traced = journal_key(kind(samples=8)), journal_key(kind(renderer="traced", samples=8))
    assert "samples" not in plain
    assert traced["samples"] == 8
    assert "thin_lens" not in plain.get("camera", {})
