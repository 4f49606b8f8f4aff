"""COLMAP models: pycolmap opens them, and its own projection of every point meets its observation."""

from pathlib import Path
from typing import Any

import numpy as np
import pycolmap
import pytest
from peaksim.camera.calibration_file import colmap_line
from peaksim.corpus.check_spec import check_spec
from peaksim.corpus.colmap import colmap_writer
from peaksim.corpus.spec import CorpusSpec
from peaksim.errors import SceneError

from tests.peaksim.corpus.helpers import MemoryFile, tiny_records, tiny_spec

CAMERAS: dict[str, dict[str, Any]] = {
    "PINHOLE": {},
    "OPENCV": {"distortion": [-0.2, 0.03, 0.002, -0.003]},
    "FULL_OPENCV": {"distortion": [-0.2, 0.03, 0.002, -0.003, 0.01]},
    "OPENCV_FISHEYE": {"distortion": [0.02, -0.01, 0.003, 0.001], "model": "fisheye"},
}


def write_model(spec: CorpusSpec, records: list[dict[str, Any]], folder: Path) -> pycolmap.Reconstruction:
    names = ("cameras.txt", "images.txt", "points3D.txt")
    files = [MemoryFile() for _ in names]
    with colmap_writer(files[0], files[1], files[2], spec) as add:
        for record in records:
            add(record)
    for name, file in zip(names, files, strict=True):
        (folder / name).write_bytes(file.buffer.getvalue())
    return pycolmap.Reconstruction(str(folder))


@pytest.mark.parametrize("model", CAMERAS)
def test_pycolmaps_projection_meets_every_observation(folder: Path, tmp_path: Path, model: str) -> None:
    size = {"name": "cam", "width": 64, "height": 48, "count": 2}
    camera = {**size, "fx": [50, 60], "cx": 30, "cy": 25, **CAMERAS[model]}
    spec = tiny_spec(cameras=[camera], markers={"shift_m": [-0.05, 0.05]})
    reconstruction = write_model(spec, tiny_records(spec, folder), tmp_path)
    assert reconstruction.num_images() == 12
    assert {c.model.name for c in reconstruction.cameras.values()} == {model}
    checked = 0
    for image in reconstruction.images.values():
        for point in image.points2D:
            xyz = reconstruction.points3D[point.point3D_id].xyz
            assert image.project_point(xyz) == pytest.approx(point.xy, abs=1e-6)
            checked += 1
    assert checked > 40


def test_a_marker_that_moved_between_sequences_is_not_one_point(folder: Path, tmp_path: Path) -> None:
    spec = tiny_spec(markers={"shift_m": [-0.05, 0.05]})
    records = tiny_records(spec, folder)
    reconstruction = write_model(spec, records, tmp_path)
    seen = {
        (r["sequence"], m["name"], i)
        for r in records
        for m in r["markers"]
        for i, state in enumerate(m["points_seen"])
        if state == 2
    }
    assert reconstruction.num_points3D() == len(seen)
    observations = sum(point.track.length() for point in reconstruction.points3D.values())
    assert observations == sum(m["points_seen"].count(2) for r in records for m in r["markers"])


def test_eight_coefficients_keep_their_order() -> None:
    values = {
        "width": 4,
        "height": 2,
        "fx": 1.0,
        "fy": 2.0,
        "cx": 1.5,
        "cy": 0.5,
        "model": "brown",
        "distortion": [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0],
    }
    assert colmap_line({**values, "distortion": [*values["distortion"], *6 * [0.0]]}) == colmap_line(values)
    expected = [1, 2, 2, 1, 1, 2, 3, 4, 5, 6, 7, 8]
    assert colmap_line(values).split()[:3] == ["FULL_OPENCV", "4", "2"]
    assert np.array_equal(np.array(colmap_line(values).split()[3:], dtype=float), expected)


def test_a_lens_that_colmap_has_no_model_of_is_refused_before_anything_is_rendered(folder: Path) -> None:
    prism = [-0.2, 0.03, 0.002, -0.003, *4 * [0.0], 0.01, 0.0, 0.0, 0.0]
    spec = tiny_spec(cameras=[{"name": "cam", "width": 64, "height": 48, "fx": 50, "distortion": prism}])
    with pytest.raises(SceneError, match=r"cameras.cam: distortion: expected zeros .*COLMAP .*thin prism.*\[0.01, 0"):
        check_spec(spec, folder)
