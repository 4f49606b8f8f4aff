"""Files that appear whole: what was there stays until the new content is complete."""

from pathlib import Path

import pytest
from peaksim.whole_file import whole_file, write_whole


def test_text_and_bytes_are_written_and_nothing_else_is_left(tmp_path: Path) -> None:
    write_whole(tmp_path / "a.txt", "é")
    write_whole(tmp_path / "a.txt", b"\x00\xff")
    assert (tmp_path / "a.txt").read_bytes() == b"\x00\xff"
    assert [path.name for path in tmp_path.iterdir()] == ["a.txt"]


def test_what_fails_midway_leaves_the_old_file(tmp_path: Path) -> None:
    write_whole(tmp_path / "film.mp4", "old")

    def fail() -> None:
        with whole_file(tmp_path / "film.mp4") as unfinished:
            unfinished.write_text("half of the new")
            assert unfinished.suffix == ".mp4"  # so that encoders know what to write
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail()
    assert (tmp_path / "film.mp4").read_text() == "old"
    assert [path.name for path in tmp_path.iterdir()] == ["film.mp4"]
