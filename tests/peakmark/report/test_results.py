"""Result folders: whole or not at all."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from peakmark.errors import InputError
from peakmark.report.results import result_folder, write_json
from tests.peaksim.corpus.helpers import child_environment


def test_files_appear_only_when_the_block_ends(tmp_path: Path) -> None:
    out = tmp_path / "a" / "b"
    with result_folder(out) as stage:
        (stage / "picture.png").write_bytes(b"1")
        write_json(stage / "result.json", {"x": 1, "y": None})
        assert not (out / "picture.png").exists()
    assert sorted(p.name for p in out.iterdir()) == ["picture.png", "result.json"]
    assert json.loads((out / "result.json").read_text()) == {"x": 1, "y": None}


def test_an_exception_leaves_earlier_results_alone(tmp_path: Path) -> None:
    (tmp_path / "result.json").write_text("old")

    def fails_midway() -> None:
        with result_folder(tmp_path) as stage:
            (stage / "result.json").write_text("new")
            raise InputError("bad scene")

    with pytest.raises(InputError, match="bad scene"):
        fails_midway()
    assert [p.name for p in tmp_path.iterdir()] == ["result.json"]
    assert (tmp_path / "result.json").read_text() == "old"


def test_same_names_are_replaced_and_others_stay(tmp_path: Path) -> None:
    (tmp_path / "result.json").write_text("old")
    (tmp_path / "mine.txt").write_text("keep")
    with result_folder(tmp_path) as stage:
        (stage / "result.json").write_text("new")
    assert (tmp_path / "result.json").read_text() == "new"
    assert (tmp_path / "mine.txt").read_text() == "keep"


def test_what_a_killed_run_left_is_removed_and_what_another_works_on_stays(tmp_path: Path) -> None:
    killed = (
        "import os, sys; from peakmark.report.results import result_folder\n"
        "with result_folder(sys.argv[1]) as stage: (stage / 'half').write_text('x'); os.kill(os.getpid(), 9)"
    )
    subprocess.run(
        [sys.executable, "-c", killed, str(tmp_path)], env={**os.environ, **child_environment()}, check=False
    )
    (left,) = tmp_path.iterdir()
    with result_folder(tmp_path) as first, result_folder(tmp_path) as second:
        assert {first, second} == set(tmp_path.iterdir())
        assert left not in (first, second)
    assert not list(tmp_path.iterdir())


def test_a_file_in_the_way_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("I am a file")
    with pytest.raises(InputError, match="expected a folder, found a file"), result_folder(tmp_path / "out"):
        pass
    with pytest.raises(InputError, match="--out"), result_folder(tmp_path / "out" / "below"):
        pass


def test_a_full_disk_is_bad_input_and_leaves_nothing(tmp_path: Path) -> None:
    out = tmp_path / "full"

    def runs_out_of_room() -> None:
        with result_folder(out) as stage, open("/dev/full", "wb", buffering=0) as full:  # the kernel's own full disk
            (stage / "half").write_bytes(b"half")
            full.write(b"x")

    with pytest.raises(InputError, match="No space left"):
        runs_out_of_room()
    assert not out.exists()


def test_json_refuses_nan(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="Out of range"):
        write_json(tmp_path / "x.json", {"x": float("nan")})
