"""COCO key points (cocodataset.org/#format-data): one category for each kind of marker.

Key points are in COCO's pixel convention, which is ours: whole numbers are pixel centres. Boxes, polygons and areas
are too, where the image's top-left corner is (0, 0), so they are ours + ½.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from peaksim.corpus.layout import image_name
from peaksim.corpus.sample import KEYPOINTS, UNSEEN, Record, marker_outlines, to_line
from peaksim.corpus.spec import CorpusSpec
from peaksim.corpus.store.base import Writing
from peaksim.geometry.polygon import polygon_area

MOST_MARKERS = 10_000
"""In one frame; annotation numbers are built on it."""

_SKELETON = [[2, 3], [3, 4], [4, 5], [5, 2]]


@contextmanager
def coco_writer(file: Writing, spec: CorpusSpec, kinds: Sequence[str]) -> Iterator[Callable[[Record], None]]:
    """Yield a function that adds a frame to a COCO file.

    `kinds` are all of the corpus, so that category numbers agree between its parts.
    """
    categories = {kind: number for number, kind in enumerate(kinds, 1)}
    images: list[dict[str, Any]] = []
    separator = b""
    file.write(b'{"info":' + _json({"description": spec.name, "version": "1"}) + b',"licenses":[],"annotations":[')

    def add(record: Record) -> None:
        nonlocal separator
        images.append(_image(spec, record))
        visible = [marker for marker in record["markers"] if marker["visible_fraction"] > 0]
        outlines = marker_outlines(record, visible)
        for number, (marker, outline) in enumerate(zip(visible, outlines, strict=True), 1):
            if len(outline):
                annotation = _annotation(record, marker, outline + 0.5, number, categories[marker["kind"]])
                file.write(separator + _json(annotation))
                separator = b",\n"

    yield add
    listed = [
        {"id": number, "name": kind, "supercategory": "marker", "keypoints": list(KEYPOINTS), "skeleton": _SKELETON}
        for kind, number in categories.items()
    ]
    file.write(b'],"images":' + _json(images) + b',"categories":' + _json(listed) + b"}\n")


def _json(value: Any) -> bytes:
    return to_line(value)[:-1]


def _image(spec: CorpusSpec, record: Record) -> dict[str, Any]:
    camera = record["camera"]
    name = image_name(spec, record["frame"]).removeprefix("frames/")
    return {"id": record["frame"], "file_name": name, "width": camera["width"], "height": camera["height"]}


def _annotation(
    record: Record, marker: dict[str, Any], outline: NDArray[np.float64], number: int, category: int
) -> dict[str, Any]:
    """Return a marker's annotation; its (n, 2) outline is in COCO's own px."""
    states = marker["points_seen"]
    points = [
        [0.0, 0.0, 0] if state == UNSEEN else [*xy, state]
        for xy, state in zip(marker["points_xy"], states, strict=True)
    ]
    low, high = outline.min(axis=0), outline.max(axis=0)
    return {
        "id": record["frame"] * MOST_MARKERS + number,
        "image_id": record["frame"],
        "category_id": category,
        "keypoints": [value for point in points for value in point],
        "num_keypoints": sum(state != UNSEEN for state in states),
        "bbox": [*map(float, low), *map(float, high - low)],
        "area": abs(polygon_area(outline)),
        "segmentation": [[float(value) for value in outline.ravel()]],
        "iscrowd": 0,
        "visible_fraction": marker["visible_fraction"],
        "marker": marker["name"],
    }
