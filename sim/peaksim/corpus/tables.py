"""Parquet tables: one row a frame, and one row a marker in a frame."""

import json
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import fields
from typing import Any

import numpy as np
import scipy

from peaksim.camera.sensor import Sensor
from peaksim.corpus.layout import image_name, shard_name
from peaksim.corpus.sample import KEYPOINTS, Record
from peaksim.corpus.spec import CorpusSpec
from peaksim.corpus.store.base import Writing
from peaksim.extras import needs_extra

Row = dict[str, Any]

_ROW_GROUP = 20_000  # rows that are held in memory


@contextmanager
@needs_extra
def parquet_writer(file: Writing, columns: dict[str, str]) -> Iterator[Callable[[Row], None]]:
    """Yield a function that adds a row to a Parquet file; `columns` gives each one's Arrow type, such as "int64"."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    schema = pa.schema([(name, getattr(pa, kind)()) for name, kind in columns.items()])
    rows: list[Row] = []
    with pq.ParquetWriter(file, schema, compression="zstd") as writer:

        def flush() -> None:
            writer.write_table(pa.Table.from_pylist(rows, schema=schema))
            rows.clear()

        def add(row: Row) -> None:
            rows.append(row)
            if len(rows) >= _ROW_GROUP:
                flush()

        yield add
        flush()


FRAME_COLUMNS = {
    **dict.fromkeys(("frame", "sequence"), "int64"),
    **dict.fromkeys(("picture", "shard", "picture_sha256", "scene", "view", "camera"), "string"),
    **dict.fromkeys(("renderer", "gl_renderer"), "string"),
    **dict.fromkeys(("width", "height", "markers"), "int32"),
    **dict.fromkeys(("fx", "fy", "cx", "cy", "time_s", "tx_m", "ty_m", "tz_m", "qx", "qy", "qz", "qw"), "float64"),
    **dict.fromkeys(("ambient", "directional"), "float64"),
    **{f"sensor_{field.name}": "string" if isinstance(field.default, str) else "float64" for field in fields(Sensor)},
}
"""Columns of frames.parquet; the pose is world_from_camera."""

MARKER_COLUMNS = {
    **dict.fromkeys(("frame", "sequence"), "int64"),
    **dict.fromkeys(("name", "kind"), "string"),
    **dict.fromkeys(("side_m", "side_px", "distance_m", "tilt_deg", "visible_fraction", "bend_radius_m"), "float64"),
    **{f"{point}_{axis}": "float64" for point in KEYPOINTS for axis in "xy"},
    **{f"{point}_seen": "int8" for point in KEYPOINTS},
}
"""Columns of markers.parquet: positions in px, seen is 0 outside, 1 covered, 2 seen."""


def frame_row(spec: CorpusSpec, record: Record) -> Row:
    """Return a frame's row."""
    pose, camera = np.array(record["world_from_camera"]), record["camera"]
    quaternion = scipy.spatial.transform.Rotation.from_matrix(pose[:3, :3]).as_quat(canonical=True)
    lights = {light["kind"]: light.get("intensity") for light in record["lights"]}
    return {
        **{name: record[name] for name in ("frame", "sequence", "scene", "view", "time_s", "renderer", "gl_renderer")},
        "picture": image_name(spec, record["frame"]),
        "shard": shard_name(record["frame"] // spec.store.shard_frames),
        "picture_sha256": record["picture_sha256"],
        "camera": camera["name"],
        **{name: camera[name] for name in ("width", "height", "fx", "fy", "cx", "cy")},
        "markers": len(record["markers"]),
        **dict(zip(("tx_m", "ty_m", "tz_m"), map(float, pose[:3, 3]), strict=True)),
        **dict(zip(("qx", "qy", "qz", "qw"), map(float, quaternion), strict=True)),
        "ambient": lights.get("ambient"),
        "directional": lights.get("directional"),
        **{f"sensor_{name}": _cell(value) for name, value in record["sensor"].items()},
    }


def _cell(value: Any) -> float | str:
    """Return a sensor's field as a table holds it: a number, a word, or the points of a curve as JSON."""
    return value if isinstance(value, str) else json.dumps(value) if isinstance(value, list) else float(value)


def marker_rows(record: Record) -> Iterable[Row]:
    """Yield a frame's markers."""
    for marker in record["markers"]:
        row: Row = {"frame": record["frame"], "sequence": record["sequence"]}
        row |= {name: marker[name] for name in MARKER_COLUMNS if name in marker}
        for point, xy, state in zip(KEYPOINTS, marker["points_xy"], marker["points_seen"], strict=True):
            row |= {f"{point}_x": xy[0], f"{point}_y": xy[1], f"{point}_seen": state}
        yield row
