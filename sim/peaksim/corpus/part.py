"""All tables of a part, written side by side in one pass over its records."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager

import numpy as np

from peaksim.corpus.coco import coco_writer
from peaksim.corpus.colmap import colmap_writer
from peaksim.corpus.configuration import Configuration
from peaksim.corpus.layout import TABLES
from peaksim.corpus.sample import Record
from peaksim.corpus.store.base import Writing
from peaksim.corpus.tables import FRAME_COLUMNS, MARKER_COLUMNS, frame_row, marker_rows, parquet_writer
from peaksim.geometry.trajectory import Trajectory
from peaksim.geometry.trajectory_file import to_text


@contextmanager
def part_tables(
    configuration: Configuration, create: Callable[[str], AbstractContextManager[Writing]]
) -> Iterator[Callable[[Record], None]]:
    """Yield a function that adds a frame to all tables; `create` opens each by its name."""
    spec = configuration.spec
    with ExitStack() as stack:
        files = {name: stack.enter_context(create(name)) for name in TABLES}
        add_frame = stack.enter_context(parquet_writer(files["frames.parquet"], FRAME_COLUMNS))
        add_marker = stack.enter_context(parquet_writer(files["markers.parquet"], MARKER_COLUMNS))
        add_to_coco = stack.enter_context(coco_writer(files["coco_keypoints.json"], spec, configuration.kinds))
        cameras, images, points = (files[f"colmap/{name}.txt"] for name in ("cameras", "images", "points3D"))
        add_to_colmap = stack.enter_context(colmap_writer(cameras, images, points, spec))

        def add(record: Record) -> None:
            add_frame(frame_row(spec, record))
            for row in marker_rows(record):
                add_marker(row)
            add_to_coco(record)
            add_to_colmap(record)
            files["poses_tum.txt"].write(tum_line(record, spec.frames_per_second).encode())

        yield add


def tum_line(record: Record, frames_per_second: float) -> str:
    """Return a frame's pose as a line of a TUM file; its time is frame / rate, which increases over sequences."""
    pose = np.array([record["world_from_camera"]])
    return to_text(Trajectory(np.array([record["frame"] / frames_per_second]), pose)).splitlines()[-1] + "\n"
