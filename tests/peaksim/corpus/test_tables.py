"""Parquet tables: read back by pyarrow, equal to the records, of the same bytes each time."""

from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from peaksim.corpus.tables import FRAME_COLUMNS, MARKER_COLUMNS, Row, frame_row, marker_rows, parquet_writer
from scipy.spatial.transform import Rotation

from tests.peaksim.corpus.helpers import MemoryFile, tiny_records, tiny_spec


def written(rows: list[Row], columns: dict[str, str]) -> bytes:
    file = MemoryFile()
    with parquet_writer(file, columns) as add:
        for row in rows:
            add(row)
    return file.buffer.getvalue()


@pytest.fixture
def records(folder: Path) -> list[dict[str, Any]]:
    return tiny_records(tiny_spec(light={"ambient": [0.5, 1]}), folder)


def test_the_frames_table_has_pose_camera_and_sensor(records: list[dict[str, Any]]) -> None:
    rows = [frame_row(tiny_spec(), record) for record in records]
    table = pq.read_table(BytesIO(written(rows, FRAME_COLUMNS)))
    assert table.num_rows == 12
    for record, row in zip(records, table.to_pylist(), strict=True):
        pose = np.array(record["world_from_camera"])
        assert np.allclose(Rotation.from_quat([row[q] for q in ("qx", "qy", "qz", "qw")]).as_matrix(), pose[:3, :3])
        assert [row["tx_m"], row["ty_m"], row["tz_m"]] == pose[:3, 3].tolist()
        assert row["fx"] == record["camera"]["fx"]
        assert row["sensor_read_noise"] == record["sensor"]["read_noise"]
        assert row["ambient"] == record["lights"][0]["intensity"]
        assert row["directional"] is None
        assert row["markers"] == len(record["markers"])
        assert row["picture"] == f"frames/{record['frame'] // 3:06d}/{record['frame']:08d}.png"
        assert row["shard"] == f"shards/{record['frame'] // 3:06d}.tar"


def test_the_markers_table_has_every_point(records: list[dict[str, Any]]) -> None:
    rows = [row for record in records for row in marker_rows(record)]
    table = pq.read_table(BytesIO(written(rows, MARKER_COLUMNS))).to_pylist()
    listed = [(record["frame"], marker) for record in records for marker in record["markers"]]
    assert len(table) == len(listed) > 12
    for (frame, marker), row in zip(listed, table, strict=True):
        assert (row["frame"], row["name"], row["tilt_deg"]) == (frame, marker["name"], marker["tilt_deg"])
        assert [row["center_x"], row["center_y"]] == marker["points_xy"][0]
        assert [row["bottom_left_x"], row["bottom_left_y"]] == marker["points_xy"][4]
        assert row["top_right_seen"] == marker["points_seen"][2]


def test_the_bytes_depend_on_the_rows_alone(records: list[dict[str, Any]]) -> None:
    rows = [row for record in records for row in marker_rows(record)]
    assert written(rows, MARKER_COLUMNS) == written(list(rows), MARKER_COLUMNS)


def test_a_table_larger_than_a_row_group_is_whole() -> None:
    table = pq.read_table(BytesIO(written([{"frame": i} for i in range(45_000)], {"frame": "int64"})))
    assert table["frame"].to_pylist() == list(range(45_000))


def test_no_rows_are_an_empty_table() -> None:
    assert pq.read_table(BytesIO(written([], MARKER_COLUMNS))).column_names == list(MARKER_COLUMNS)
