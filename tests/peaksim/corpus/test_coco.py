"""COCO key points: read by pycocotools, equal to the truth, boxes and polygons in COCO's own pixel convention."""

from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from peaksim import Camera, Mark, Quad, Scene, Texture
from peaksim.corpus.cameras import NamedCamera
from peaksim.corpus.coco import coco_writer
from peaksim.corpus.plan import FramePlan, plan_frame
from peaksim.corpus.sample import from_line, record_of, render_frame, to_line
from peaksim.geometry.pose import compose, rotation_about
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


CLOSE_CAMERAS = (
    Camera(160, 120, 140.0),
    Camera(160, 120, 120.0, 125.0, 77.0, 62.0, (-0.25, 0.06, 0.002, -0.001)),
    Camera(160, 120, 90.0, model="fisheye"),
)


def close_views(folder: Path) -> list[FramePlan]:
    """Return views of a marker of 0.8 m from 3 to 30 cm above it, most of which it reaches behind."""
    plan = plan_frame(tiny_spec(), folder, 0)
    texture = Texture.from_array(np.full((2, 2), 200, np.uint8))
    scene = Scene((Quad("marker", texture, (0.8, 0.8), np.eye(4), Mark("close", KINDS[0], 0.8)),))
    views = product(CLOSE_CAMERAS, (0.03, 0.1, 0.3), (10.0, 45.0, 60.0, 70.0))
    return [
        replace(
            plan,
            index=index,
            scene=scene,
            sequence=replace(plan.sequence, camera=NamedCamera("cam", camera, 1.0)),
            world_from_camera=compose(np.diag([1.0, -1, -1]) @ rotation_about("x", tilt_deg), [0.01, -0.02, height_m]),
        )
        for index, (camera, height_m, tilt_deg) in enumerate(views)
    ]


def test_markers_that_reach_behind_the_camera_have_their_box_and_mask(folder: Path, tmp_path: Path) -> None:
    file, shown = MemoryFile(), []
    with coco_writer(file, tiny_spec(), KINDS) as add:
        for plan in close_views(folder):
            frame = render_frame(plan, "exact")
            add(from_line(to_line(record_of(plan, frame, b"")), "record"))
            shown.append(frame.quad_ids == 0)
    (tmp_path / "coco.json").write_bytes(file.buffer.getvalue())
    coco = COCO(str(tmp_path / "coco.json"))
    annotations = coco.loadAnns(coco.getAnnIds())
    assert [annotation["image_id"] for annotation in annotations] == list(range(len(shown)))
    assert sum(annotation["num_keypoints"] == 0 for annotation in annotations) > 10
    for annotation, pixels in zip(annotations, shown, strict=True):
        mask = coco.annToMask(annotation).astype(bool)
        assert (mask & pixels).sum() >= 0.96 * (mask | pixels).sum()
        assert annotation["area"] == pytest.approx(pixels.sum(), rel=0.02)
        rows, columns = np.nonzero(pixels)
        box = [columns.min(), rows.min(), np.ptp(columns) + 1, np.ptp(rows) + 1]
        assert np.allclose(annotation["bbox"], box, atol=4)
        assert 0 < annotation["visible_fraction"] <= 1
        assert len(annotation["segmentation"][0]) >= 6
