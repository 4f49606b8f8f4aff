"""Key point files: what is written comes back bit for bit; what is damaged is one line."""

import json
from pathlib import Path

import numpy as np
import pytest

from peakmark.errors import InputError
from peakmark.keypoints.files import load_settings
from peakmark.keypoints.keypoints import Keypoints
from tests.places import GOLDEN
from tests.samples import assert_equal, some_keypoints

ENDINGS = (".npz", ".csv", ".json")


@pytest.mark.parametrize("ending", ENDINGS)
@pytest.mark.parametrize("count", [0, 1, 9])
@pytest.mark.parametrize("descriptor_length", [None, 4])
def test_round_trip_is_exact(tmp_path: Path, ending: str, count: int, descriptor_length: int | None) -> None:
    keypoints = some_keypoints(count, descriptor_length)
    path = tmp_path / f"points{ending}"
    keypoints.save(path, {"threshold": 100.5, "note": "a, b\nc"})
    assert_equal(Keypoints.load(path), keypoints)
    assert load_settings(path) == {"threshold": 100.5, "note": "a, b\nc"}


def test_csv_reads_as_a_table(tmp_path: Path) -> None:
    some_keypoints(2).save(tmp_path / "points.csv")
    lines = (tmp_path / "points.csv").read_text().splitlines()
    assert lines[0] == "# {}"
    assert lines[1].split(",") == [
        "x",
        "y",
        "size",
        "angle",
        "response",
        "octave",
        "laplacian",
        "scale",
        "d0",
        "d1",
        "d2",
        "d3",
    ]
    assert len(lines) == 4


def test_reference_files_of_others_load_without_a_scale() -> None:
    path = GOLDEN / "surf" / "coins.default.npz"
    keypoints = Keypoints.load(path)
    assert len(keypoints) == 817
    np.testing.assert_array_equal(keypoints.scale, keypoints.size)
    assert load_settings(path)["hessianThreshold"] == 100


@pytest.mark.parametrize("ending", ENDINGS)
def test_damaged_files_are_one_line_that_names_them(tmp_path: Path, ending: str) -> None:
    path = tmp_path / f"points{ending}"
    some_keypoints().save(path)
    whole = path.read_bytes()
    for damaged in (b"", b"nonsense", whole[: len(whole) // 2]):
        path.write_bytes(damaged)
        with pytest.raises(InputError) as caught:
            Keypoints.load(path)
        assert str(path) in str(caught.value)


def test_missing_columns_and_files_are_named(tmp_path: Path) -> None:
    np.savez(tmp_path / "part.npz", xy=np.zeros((2, 2)), size=np.ones(2))
    with pytest.raises(InputError, match="angle, response, octave, laplacian missing"):
        Keypoints.load(tmp_path / "part.npz")
    with pytest.raises(InputError, match=r"none\.npz"):
        Keypoints.load(tmp_path / "none.npz")
    for use in (Keypoints.load, some_keypoints().save):
        with pytest.raises(InputError, match=r"\.npz, \.csv or \.json"):
            use(tmp_path / "points.txt")


def test_pickles_are_refused(tmp_path: Path) -> None:
    np.savez(tmp_path / "evil.npz", xy=np.array([{"a": 1}], dtype=object), allow_pickle=True)
    with pytest.raises(InputError):
        Keypoints.load(tmp_path / "evil.npz")


def test_json_is_plain(tmp_path: Path) -> None:
    some_keypoints(1, None).save(tmp_path / "points.json", {"octaves": 4})
    content = json.loads((tmp_path / "points.json").read_text())
    assert content["settings"] == {"octaves": 4}
    assert len(content["xy"][0]) == 2
