"""Calibration files: each format written and read back; files as others write them; what is none is one line."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from peaksim.camera.camera import Camera
from peaksim.errors import InputError

PLAIN = Camera(640, 480, 501.25, 499.5, 320.125, 238.1)
BROWN = replace(PLAIN, distortion=(-0.2, 0.05, 0.001, -0.002, 0.01))
RADTAN = replace(PLAIN, distortion=(-0.2, 0.05, 0.001, -0.002))
RATIONAL = replace(PLAIN, distortion=(-0.2, 0.05, 0.001, -0.002, 0.01, 0.1, 0.02, 0.003))
FISHEYE = replace(PLAIN, distortion=(0.02, -0.01, 0.003, 0.001), model="fisheye")
POINTS = np.random.default_rng(0).uniform([-0.4, -0.3, 0.8], [0.4, 0.3, 2], (50, 3))


def assert_same(a: Camera, b: Camera) -> None:
    """Fail unless two cameras project alike and are of one size."""
    assert (a.width, a.height, a.model) == (b.width, b.height, b.model)
    assert np.abs(a.project(POINTS) - b.project(POINTS)).max() < 1e-9


@pytest.mark.parametrize(
    "camera", [PLAIN, RADTAN, BROWN, RATIONAL, FISHEYE], ids=lambda c: f"{c.model}{len(c.distortion)}"
)
@pytest.mark.parametrize(
    ("name", "format"),
    [
        ("c.yaml", None),
        ("c.xml", None),
        ("c.json", None),
        ("c.yml", "ros"),
        ("c.yaml", "kalibr"),
        ("cameras.txt", None),
    ],
)
def test_what_is_saved_is_loaded(tmp_path: Path, camera: Camera, name: str, format: str | None) -> None:
    path = tmp_path / name
    if format == "kalibr" and len(camera.distortion) > 4:
        with pytest.raises(InputError, match="expected zeros after the first four, for Kalibr"):
            camera.save(path, format=format)
        return
    camera.save(path, format=format)
    assert_same(Camera.load(path), camera)


@pytest.mark.parametrize("ending", ["yaml", "xml", "json"])
def test_opencv_reads_what_is_saved(tmp_path: Path, ending: str) -> None:
    BROWN.save(tmp_path / f"c.{ending}")
    storage = cv2.FileStorage(str(tmp_path / f"c.{ending}"), cv2.FileStorage_READ)
    assert np.array_equal(storage.getNode("camera_matrix").mat(), BROWN.matrix)
    assert storage.getNode("distortion_coefficients").mat().ravel().tolist() == list(BROWN.distortion)
    assert storage.getNode("image_width").real() == 640


def test_pycolmap_reads_what_is_saved(tmp_path: Path) -> None:
    pycolmap = pytest.importorskip("pycolmap")
    FISHEYE.save(tmp_path / "cameras.txt")
    _, model, *_ = (tmp_path / "cameras.txt").read_text().splitlines()[1].split()
    numbers = [float(x) for x in (tmp_path / "cameras.txt").read_text().splitlines()[1].split()[4:]]
    there = pycolmap.Camera(model=model, width=640, height=480, params=numbers)
    flat = POINTS[:, :2] / POINTS[:, 2:]
    project = [there.img_from_cam(np.array([x, y, 1.0])) for x, y in flat]
    assert np.abs(np.array(project) - 0.5 - FISHEYE.project(POINTS)).max() < 1e-9


OPENCV_SAMPLE = """%YAML:1.0
---
calibration_time: "Sun 29 Nov 2026"
image_Width: 640
image_Height: 480
flags: 2
fisheye_model: 0
Camera_Matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 501.25, 0., 320.125, 0., 499.5, 238.1, 0., 0., 1. ]
Distortion_Coefficients: !!opencv-matrix
   rows: 5
   cols: 1
   dt: d
   data: [ -0.2, 0.05, 0.001, -0.002, 0.01 ]
"""
ROS_MESSAGE = """header: {seq: 1, frame_id: camera}
height: 480
width: 640
distortion_model: "plumb_bob"
D: [-0.2, 0.05, 0.001, -0.002, 0.01]
K: [501.25, 0.0, 320.125, 0.0, 499.5, 238.1, 0.0, 0.0, 1.0]
R: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
binning_x: 0
roi: {x_offset: 0, y_offset: 0, height: 0, width: 0, do_rectify: false}
"""
KALIBR = """cam0:
  cam_overlaps: [1]
  camera_model: pinhole
  distortion_coeffs: [0.02, -0.01, 0.003, 0.001]
  distortion_model: equidistant
  intrinsics: [501.25, 499.5, 320.125, 238.1]
  resolution: [640, 480]
  rostopic: /cam0/image_raw
cam1:
  camera_model: pinhole
  distortion_coeffs: [-0.2, 0.05, 0.001, -0.002]
  distortion_model: radtan
  intrinsics: [501.25, 499.5, 320.125, 238.1]
  resolution: [640, 480]
"""
COLMAP = """# Camera list with one line of data per camera:
1 OPENCV 640 480 501.25 499.5 320.625 238.6 -0.2 0.05 0.001 -0.002
2 SIMPLE_RADIAL 640 480 501.25 320.625 238.6 -0.2
"""


@pytest.mark.parametrize(
    ("text", "choice", "camera"),
    [
        (OPENCV_SAMPLE, "", BROWN),
        (ROS_MESSAGE, "", BROWN),
        (ROS_MESSAGE.replace("K:", "k:").replace("D:", "d:"), "", BROWN),
        (KALIBR, "#cam0", FISHEYE),
        (KALIBR, "#cam1", RADTAN),
        (COLMAP, "#1", RADTAN),
        (COLMAP, "#2", replace(PLAIN, fy=501.25, distortion=(-0.2, 0, 0, 0))),
    ],
)
def test_files_of_others_are_read(tmp_path: Path, text: str, choice: str, camera: Camera) -> None:
    (tmp_path / "c").write_text("\ufeff" + text, encoding="utf-8")
    assert_same(Camera.load(f"{tmp_path}/c{choice}"), camera)


@pytest.mark.parametrize(
    ("text", "choice", "words"),
    [
        ("", "", "expected a calibration (OpenCV, ROS, Kalibr or COLMAP)"),
        ("a: [1", "", "expected a calibration (OpenCV, ROS, Kalibr or COLMAP)"),
        ("<?xml version='1.0'?><a>", "", "expected a calibration"),
        ("image_width: 640", "", "camera_matrix missing"),
        (OPENCV_SAMPLE.replace("image_W", "W"), "", "image_width and image_height missing"),
        (OPENCV_SAMPLE.replace("501.25, 0.", "501.25, 0.3"), "", "expected a camera matrix fx 0 cx"),
        (ROS_MESSAGE.replace("binning_x: 0", "binning_x: 2"), "", "of the whole image"),
        (ROS_MESSAGE.replace("plumb_bob", "double_sphere"), "", "distortion_model: expected one of plumb_bob"),
        (ROS_MESSAGE.replace("501.25", "-1"), "", "fx: expected a positive focal length"),
        (ROS_MESSAGE.replace("0.05", ".nan"), "", "expected finite numbers"),
        (KALIBR, "", "expected one of the cameras cam0, cam1, as in FILE#cam0, got several"),
        (KALIBR, "#cam7", "got 'cam7'"),
        (KALIBR.replace("pinhole", "omni"), "#cam0", "camera_model: expected pinhole, got 'omni'"),
        (COLMAP.replace("-0.002", ""), "#1", "expected 8 parameters for OPENCV, got 7"),
        (COLMAP.replace("OPENCV", "FOV"), "#1", "expected a camera model of SIMPLE_PINHOLE"),
        ("[" * 5000, "", "expected a calibration"),
        ("!!python/object/apply:os.system ['true']", "", "expected a calibration"),
    ],
)
def test_what_is_no_calibration_is_one_line(tmp_path: Path, text: str, choice: str, words: str) -> None:
    (tmp_path / "c.yaml").write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as error:
        Camera.load(f"{tmp_path}/c.yaml{choice}")
    assert words in str(error.value)
    assert f"{tmp_path}/c.yaml" in str(error.value)
    assert len(str(error.value).splitlines()) == 1


def test_a_missing_file_and_an_unknown_ending_are_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.yaml: cannot be read: No such file"):
        Camera.load(tmp_path / "none.yaml")
    with pytest.raises(InputError, match=r"c\.ini: expected a name ending in \.yaml"):
        PLAIN.save(tmp_path / "c.ini")
