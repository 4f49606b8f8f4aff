"""Rows: one an array and one a marker, with what is known of it, the same from every file format."""

import csv
import json
from collections.abc import Iterator
from dataclasses import asdict, replace
from pathlib import Path
from weakref import WeakSet

import numpy as np
import pytest
from peaksim import load_scene, render
from pyarrow import parquet

from peakmark.errors import InputError
from peakmark.found import find
from peakmark.found.found import Found, found_in
from peakmark.found.rows import FoundRow
from peakmark.found.tables import CORNER_COLUMNS, write_rows
from tests.helpers import marker_view
from tests.peakmark.arrays.arrays_scene import CAMERA, detections, facing_wall, printed_array


def found_array() -> Found:
    blank = np.full((CAMERA.height, CAMERA.width), 255, np.uint8)
    markers, shapes = detections(printed_array(5), facing_wall(2.0, 20.0, 0.0, 30.0))
    return found_in(blank, [replace(d, affinity=shape) for d, shape in zip(markers, shapes, strict=True)])


def test_a_marker_is_where_it_was_drawn() -> None:
    (row,) = find(marker_view(60, 20)).rows("a.png", 3)
    assert (row.file, row.frame, row.kind, row.polarity, row.code) == ("a.png", 3, "marker", "dark", None)
    assert (row.x, row.y, row.side_px) == pytest.approx((128, 128, 60), abs=0.1)
    turned = np.radians(45 + 20 + 90 * np.arange(4))
    drawn = 128 + 30 * np.sqrt(2) * np.stack([np.cos(turned), -np.sin(turned)], axis=1)
    gaps = np.linalg.norm(np.array(row.corners)[:, None] - drawn, axis=2)
    assert gaps.min(axis=1).max() < 0.2
    assert row.probability is not None
    assert row.probability > 0.9
    assert row.sigma_px is not None
    assert 0 < row.sigma_px < 0.1


def test_an_array_stands_before_its_markers_and_its_corners_hold_them() -> None:
    rows = found_array().rows()
    assert [row.kind for row in rows] == ["array", "marker", "marker", "marker"]
    assert [row.code for row in rows] == [5, None, None, None]
    assert (rows[0].x, rows[0].y) == pytest.approx(np.mean([(row.x, row.y) for row in rows[1:]], axis=0))
    box = np.array(rows[0].corners)
    edges = np.roll(box, -1, axis=0) - box
    for row in rows[1:]:
        along = np.array([row.x, row.y]) - box
        assert (edges[:, 0] * along[:, 1] - edges[:, 1] * along[:, 0] > 0).all()  # on the right of every edge


def test_a_marker_that_only_an_array_asked_for_is_among_the_markers() -> None:
    scene, camera, trajectory = load_scene("cave")
    image = render(scene, camera, trajectory.at(0.0)).image
    complete = find(image)
    member = complete.arrays[0].detections[0]
    found = found_in(image, [marker for marker in complete.markers if marker is not member])
    assert [array.code for array in found.arrays] == [array.code for array in complete.arrays]
    assert found.markers[-1].xy == pytest.approx(member.xy, abs=0.05)
    known = {id(marker) for marker in found.markers}
    assert all(id(marker) in known for array in found.arrays for marker in array.detections)


def restored(path: Path) -> list[FoundRow]:
    """Read rows from a file with readers that are not ours."""
    if path.suffix == ".parquet":
        plain = parquet.read_table(path).to_pylist()
    elif path.suffix == ".jsonl":
        plain = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
    else:
        with path.open(newline="", encoding="utf-8") as file:
            plain = [_from_csv(row) for row in csv.DictReader(file)]
    return [FoundRow(**{**row, "corners": tuple(map(tuple, row["corners"]))}) for row in plain]


def _from_csv(row: dict[str, str]) -> dict[str, object]:
    corners = np.array([float(row.pop(name)) for name in CORNER_COLUMNS]).reshape(4, 2).tolist()
    texts = {name: row.pop(name) or None for name in ("file", "kind", "polarity", "pattern")}
    whole = {name: int(text) if (text := row.pop(name)) else None for name in ("frame", "code")}
    doubt = row.pop("doubt")
    return {
        **{k: float(v) if v else None for k, v in row.items()},
        **texts,
        **whole,
        "corners": corners,
        "doubt": doubt,
    }


@pytest.mark.parametrize("ending", [".csv", ".jsonl", ".parquet"])
def test_every_format_holds_every_row(tmp_path: Path, ending: str) -> None:
    rows = found_array().rows("in/é.png", 7)
    write_rows(tmp_path / "deep" / f"found{ending}", rows)
    assert restored(tmp_path / "deep" / f"found{ending}") == list(rows)
    write_rows(tmp_path / f"none{ending}", [])
    assert restored(tmp_path / f"none{ending}") == []


@pytest.mark.parametrize("ending", [".csv", ".jsonl", ".parquet"])
def test_rows_are_written_as_they_come(tmp_path: Path, ending: str) -> None:
    first, alive, most = found_array().rows("film.mp4", 7)[0], WeakSet[FoundRow](), 0

    def rows() -> Iterator[FoundRow]:
        nonlocal most
        for frame in range(1000):
            row = replace(first, frame=frame)
            alive.add(row)
            most = max(most, len(alive))
            yield row

    write_rows(tmp_path / f"found{ending}", rows())
    assert 0 < most < 600
    assert len(restored(tmp_path / f"found{ending}")) == 1000


def test_another_ending_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"found\.xls: expected a name ending in \.csv, \.jsonl or \.parquet"):
        write_rows(tmp_path / "found.xls", [])


def test_a_data_frame_has_the_columns_of_the_csv(tmp_path: Path) -> None:
    pandas = pytest.importorskip("pandas")
    found = found_array()
    write_rows(tmp_path / "found.csv", found.rows())
    frame = found.to_dataframe()
    assert list(frame.columns) == list(pandas.read_csv(tmp_path / "found.csv").columns)
    assert frame.loc[0, "x"] == asdict(found.rows()[0])["x"]
