"""Scene files: the shipped scene's geometry by hand, and every kind of bad input as one line naming file and field."""

import re
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from peaksim import Camera, camera_named, load_scene
from peaksim.errors import SceneError
from peaksim.scene.build_camera import build_camera
from peaksim.scene.build_markers import path_poses
from peaksim.scene.schema import CameraTable, MarkerPathTable

SMALL = """
[camera]
width = 64
height = 48
fx = 50.0

[[trajectory]]
eye_m = [0.0, 0.5, 1.0]
target_m = [0.0, 2.0, 0.0]

[textures.floor]
variants = { gravel = "textures/gravel.png", brick = "textures/brick.png" }

[room]
min_m = [-1.0, 0.0, 0.0]
max_m = [1.0, 3.0, 2.0]
floor = "floor"

[[markers]]
name = "m"
kind = "surf-dark"
side_m = 0.08
border_m = 0.01
center_m = [0.0, 1.5, 0.001]
"""


@pytest.fixture
def scene_file(tmp_path: Path) -> Path:
    path = tmp_path / "small.toml"
    path.write_text(SMALL)
    return path


def test_the_floor_has_fourteen_markers_of_8_cm_on_a_curve_inside_the_room() -> None:
    scene, camera, trajectory = load_scene("floor")
    marks = [(quad, mark) for quad in scene.quads for mark in quad.marks]
    assert len(marks) == 14
    assert {mark.side_m for _, mark in marks} == {0.08}
    centers = np.array([quad.world_from_quad[:3, 3] for quad, _ in marks])
    steps = np.linalg.norm(np.diff(centers, axis=0), axis=1)
    assert np.ptp(steps) < 0.02 * steps.mean()  # equal steps
    assert np.linalg.matrix_rank(centers - centers[0], tol=0.05) == 2  # curved, not straight
    assert (camera.width, camera.height) == (2048, 1536)
    assert trajectory.at(0.0)[2, 3] == pytest.approx(1.2)


def test_a_marker_tile_is_pattern_and_white_border(scene_file: Path) -> None:
    (_, marker) = load_scene(scene_file).scene.quads
    assert marker.size_m == pytest.approx((0.10, 0.10))
    assert [m.side_m for m in marker.marks] == [0.08]
    texels = marker.texture.pixels
    assert texels.shape[:2] == (180, 180)
    assert (texels[:18] == 255).all()
    assert texels[90, 90] == 0


def test_path_tops_point_along_the_path() -> None:
    path = MarkerPathTable(name="p", kind="surf-dark", count=3, side_m=0.1, waypoints_m=((0, 0), (1, 0), (2, 0)))
    poses = path_poses(path)
    assert np.allclose([p[:2, 3] for p in poses], [[0, 0], [1, 0], [2, 0]], atol=1e-6)
    assert np.allclose([p[:3, 1] for p in poses], [[1, 0, 0]] * 3, atol=1e-9)


def test_variants_pick_another_photograph(scene_file: Path) -> None:
    default, gravel, brick = (
        load_scene(scene_file, v).scene.quads[0].texture.pixels for v in ({}, {"floor": "gravel"}, {"floor": "brick"})
    )
    assert np.array_equal(default, gravel)
    assert not np.array_equal(default, brick)


def test_wallpaper_is_mirrored_at_its_seams(scene_file: Path) -> None:
    floor = load_scene(scene_file).scene.quads[0].texture.pixels
    assert floor.shape == (3 * 512, 2 * 512)
    assert np.array_equal(floor[:512], floor[512:1024][::-1])
    assert np.array_equal(floor[:, :512], floor[:, 512:][:, ::-1])


def test_a_camera_is_described_in_pixels_in_millimetres_or_by_name(scene_file: Path) -> None:
    pixels = "width = 64\nheight = 48\nfx = 50.0"
    by_mm = "width = 64\nheight = 48\nfocal_mm = 5.0\nsensor_width_mm = 6.4\nrow_time_s = 1e-5\nexposure_s = 0.01"
    for text, expected in (
        (pixels, Camera(64, 48, 50.0, 50.0, 31.5, 23.5)),
        (by_mm, Camera(64, 48, 50.0, 50.0, 31.5, 23.5, row_time_s=1e-5, exposure_s=0.01)),
        (
            pixels + '\nmodel = "fisheye"\ndistortion = [0.01, 0.0, 0.0, 0.0]',
            Camera(64, 48, 50.0, 50.0, 31.5, 23.5, (0.01, 0.0, 0.0, 0.0), model="fisheye"),
        ),
        ('name = "sony-dsc-s85"\nfocal_mm = 21.0', camera_named("sony-dsc-s85", 21.0)),
    ):
        scene_file.write_text(SMALL.replace(pixels, text))
        assert load_scene(scene_file).camera == expected


BAD = [
    ("width = 64", "widht = 64", r"camera\.widht: unknown field \(did you mean 'width'\?\)"),
    ("width = 64\n", "", r"camera: expected width and height with either fx, or focal_mm"),
    ("fx = 50.0", "focal_mm = 5.0", r"camera: expected width and height with either fx, or focal_mm"),
    ("fx = 50.0", 'name = "sony-dsc-s85"', r"camera: expected only focal_mm beside name, got height, width"),
    ("width = 64\nheight = 48\nfx = 50.0", 'name = "box"', r"camera: name: expected one of panasonic.*got 'box'"),
    ("fx = 50.0", "fx = 50.0\nrow_time_s = -1.0", r"camera\.row_time_s: .*greater than or equal to 0"),
    ("fx = 50.0", 'fx = 50.0\nmodel = "fish"', r"camera\.model"),
    ("fx = 50.0", "fx = 50.0\ndistortion = [0.1]", r"distortion: expected one of"),
    ("width = 64", "width = 64.5", r"camera\.width: .*integer.*got 64\.5"),
    ("width = 64", "width = 0", r"camera\.width: .*greater than or equal to 1, got 0"),
    ("fx = 50.0", "fx = nan", r"camera\.fx: .*finite.*got nan"),
    ("fx = 50.0", 'fx = "50"x', r"is not TOML"),
    ("side_m = 0.08", "side_m = -0.08", r"markers\[0\]\.side_m: .*greater than 0, got -0\.08"),
    ("side_m = 0.08", "side_m = 0.08\nsize_m = 1", r"markers\[0\]\.size_m: unknown field \(did you mean 'side_m'\?\)"),
    ('kind = "surf-dark"', 'kind = "surf-drak"', r"markers\[0\]\.kind: expected one of .*surf-dark.*got 'surf-drak'"),
    ('kind = "surf-dark"', 'kind = "../x"', r"markers\[0\]\.kind"),
    ("center_m = [0.0, 1.5, 0.001]", "center_m = [0.0, 9.0, 0.001]", r"markers\[0\]\.center_m: .*inside the room"),
    ("center_m = [0.0, 1.5, 0.001]", "center_m = [0.0, 1.5]", r"markers\[0\]\.center_m\[2\]"),
    ("eye_m = [0.0, 0.5, 1.0]", "eye_m = [0.0, 0.5, -1.0]", r"trajectory\[0\]\.eye_m: .*inside the room"),
    ("eye_m = [0.0, 0.5, 1.0]", "eye_m = [0.0, 2.0, 0.0]", r"trajectory\[0\]"),
    ("target_m = [0.0, 2.0, 0.0]", "target_m = [0.0, 0.5, 0.2]", r"trajectory\[0\]: .*not parallel to up"),
    ("textures/gravel.png", "textures/gravle.png", r"textures\.floor\.variants\.gravel: .*'textures/gravle\.png'"),
    ("textures/gravel.png", "../scenes/floor.toml", r"textures\.floor\.variants\.gravel: .*inside assets"),
    ("textures/gravel.png", "README.md", r"textures\.floor\.variants\.gravel: .*README\.md"),
    ('floor = "floor"', 'floor = "flor"', r"room\.floor: expected one of floor, got 'flor'"),
    ("max_m = [1.0, 3.0, 2.0]", "max_m = [1.0, -3.0, 2.0]", r"room: expected min_m below max_m"),
    ("[camera]", "[sensor]\nlens_blur = 1.0\n[camera]", r"sensor\.lens_blur: unknown field, expected one of"),
    ("[camera]", "[sensor]\nlens_blur_px = -1.0\n[camera]", r"lens_blur_px"),
    ("[camera]", "[sensor]\nread_noise = nan\n[camera]", r"read_noise"),
    ('name = "m"', 'name = "<b>"', r"markers\[0\]\.name"),
]


@pytest.mark.parametrize(("old", "new", "message"), BAD)
def test_bad_input_names_the_file_and_the_field(scene_file: Path, old: str, new: str, message: str) -> None:
    text = SMALL.replace(old, new)
    assert text != SMALL
    scene_file.write_text(text)
    with pytest.raises(SceneError) as caught:
        load_scene(scene_file)
    line = str(caught.value)
    assert line.startswith(str(scene_file))
    assert re.search(message, line)
    assert "\n" not in line


def test_a_missing_file_and_an_unknown_variant_are_named(tmp_path: Path, scene_file: Path) -> None:
    with pytest.raises(SceneError, match=r"nowhere\.toml: cannot be read"):
        load_scene(tmp_path / "nowhere.toml")
    with pytest.raises(SceneError, match="expected one of gravel, brick, got 'marble'"):
        load_scene(scene_file, {"floor": "marble"})
    with pytest.raises(SceneError, match=r"textures\.wall: expected a texture with variants"):
        load_scene(scene_file, {"wall": "brick"})


@pytest.mark.parametrize(
    ("model", "fx", "least"), [("brown", 0.3, "14"), ("brown", 13.9, "14"), ("fisheye", 0.3, "102")]
)
def test_a_focal_length_that_is_not_in_px_is_refused(model: Literal["brown", "fisheye"], fx: float, least: str) -> None:
    table = CameraTable(width=640, height=480, fx=fx, model=model)
    with pytest.raises(SceneError, match=rf"camera: fx: expected px, at least {least}(\.\d)? for 640 px, got {fx:g}"):
        build_camera(table)
    assert build_camera(CameraTable(width=640, height=480, fx=110, model=model)).fx == 110
