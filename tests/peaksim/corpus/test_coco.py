"""COCO key points: read by pycocotools, equal to the truth, boxes and polygons in COCO's own pixel convention."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from peaksim.corpus.coco import coco_writer
from pycocotools.coco import COCO

from tests.peaksim.corpus.helpers import MemoryFile, tiny_records, tiny_spec

KINDS = ("surf-dark", "surf-light", "unused")


@pytest.fixture
def records(folder: Path) -> list[dict[str, Any]]:
    return tiny_records(tiny_spec(views=[{"kind": "marker", "distance_m": [0.2, 1.0]}]), folder)


@pytest.fixture
def coco(records: list[dict[str, Any]], tmp_path: Path) -> COCO:
    file = MemoryFile()
    with coco_writer(file, tiny_spec(), KINDS) as add:
        for record in records:
            add(record)
    (tmp_path / "coco.json").write_bytes(file.buffer.getvalue())
    return COCO(str(tmp_path / "coco.json"))


def test_pycocotools_finds_every_image_kind_and_visible_marker(coco: COCO, records: list[dict[str, Any]]) -> None:
    assert sorted(coco.getImgIds()) == list(range(12))
    assert [c["name"] for c in coco.loadCats(coco.getCatIds())] == list(KINDS)
    assert coco.loadImgs([3])[0] == {"id": 3, "file_name": "000001/00000003.png", "width": 64, "height": 48}
    visible = [(r["frame"], m["name"]) for r in records for m in r["markers"] if m["visible_fraction"] > 0]
    annotations = coco.loadAnns(coco.getAnnIds())
    assert sorted((a["image_id"], a["marker"]) for a in annotations) == sorted(visible)
    assert len({a["id"] for a in annotations}) == len(annotations) > 12


def test_key_points_are_the_truth_and_their_flags_are_cocos(coco: COCO, records: list[dict[str, Any]]) -> None:
    flags = set()
    for annotation in coco.loadAnns(coco.getAnnIds()):
        (marker,) = (m for m in records[annotation["image_id"]]["markers"] if m["name"] == annotation["marker"])
        points = np.array(annotation["keypoints"]).reshape(5, 3)
        assert points[:, 2].tolist() == marker["points_seen"]
        labelled = points[:, 2] > 0
        assert annotation["num_keypoints"] == labelled.sum()
        assert np.array_equal(points[labelled, :2], np.array(marker["points_xy"])[labelled])
        assert (points[~labelled] == 0).all()
        flags |= set(points[:, 2])
    assert {0.0, 2.0} <= flags


def test_polygons_cover_the_marker_in_cocos_pixels(coco: COCO, records: list[dict[str, Any]]) -> None:
    """COCO's own rasteriser, from the polygon, must give the area and the box that are stated."""
    for annotation in coco.loadAnns(coco.getAnnIds()):
        mask = coco.annToMask(annotation)
        assert mask.sum() == pytest.approx(annotation["area"], abs=0.6 * np.sqrt(annotation["area"]) * 4 + 2)
        x, y, width, height = annotation["bbox"]
        assert 0 <= x <= x + width <= 64
        assert 0 <= y <= y + height <= 48
        rows, columns = np.nonzero(mask)
        if len(rows):
            assert x - 1 <= columns.min() <= columns.max() + 1 <= x + width + 1
            assert y - 1 <= rows.min() <= rows.max() + 1 <= y + height + 1
