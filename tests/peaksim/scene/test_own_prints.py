"""Scene files with one's own images, printed sheets, meshes and bent paper."""

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from peaksim import load_scene, render
from peaksim.errors import SceneError
from peaksim.image_file import read_image
from peaksim.scene.sheet_file import read_sheet
from peaksim.shipped import ASSETS
from PIL import Image

HEAD = """
[camera]
width = 160
height = 120
fx = 150.0
[[trajectory]]
eye_m = [0.0, -1.0, 0.3]
target_m = [0.0, 0.0, 0.3]
"""
PAPER = "center_m = [0.0, 0.0, 0.3]\nnormal = [0.0, -1.0, 0.0]\nup = [0.0, 0.0, 1.0]\n"
MARKER = f'[[markers]]\nname = "m"\nkind = "own.png"\nside_m = 0.3\nborder_m = 0.03\n{PAPER}'
PRINTED = ((1, [60.3, 70.7], "dark", "energy"), (1, [150, 200], "light", "range"), (2, [100, 100], "dark", "energy"))
SHEET = {
    "page_mm": [210.0, 297.0],
    "markers": [
        {"page": page, "center_mm": xy, "pattern": "surf", "side_mm": 60.0, "polarity": polarity, "limit": limit}
        for page, xy, polarity, limit in PRINTED
    ],
}


def scene(folder: Path, text: str) -> Path:
    path = folder / "scene.toml"
    path.write_text(HEAD + text)
    return path


@pytest.mark.parametrize("shape", [(16, 16), (16, 16, 3)])
def test_an_image_of_ones_own_is_a_marker(shape: tuple[int, ...], tmp_path: Path) -> None:
    pixels = np.random.default_rng(0).integers(0, 200, shape).astype(np.uint8)
    Image.fromarray(pixels).save(tmp_path / "own.png")
    setup = load_scene(scene(tmp_path, MARKER))
    (quad,) = setup.scene.quads
    assert np.array_equal(quad.texture.pixels[2:-2, 2:-2], pixels)
    assert (quad.texture.pixels[:2] == 255).all()
    (truth,) = render(setup.scene, setup.camera, setup.trajectory.at(0.0), "exact").truth
    assert (truth.kind, truth.visible_fraction) == ("own.png", 1.0)
    grid = 'rows = ["OD"]\nkinds = { O = "own.png", D = "own.png" }\nside_m = 0.08\npitch_m = 0.1\n'
    poster = f'[[posters]]\nname = "p"\n{grid}{PAPER}'
    (hung,) = load_scene(scene(tmp_path, poster)).scene.quads
    assert hung.texture.pixels.shape[2:] == shape[2:]
    assert [mark.kind for mark in hung.marks] == ["own.png", "own.png"]


def test_a_bent_poster_and_marker_are_built_from_files(tmp_path: Path) -> None:
    bent = f'[[markers]]\nname = "m"\nkind = "surf-dark"\nside_m = 0.3\nbend_radius_m = -0.2\nbend_axis = "x"\n{PAPER}'
    (quad,) = load_scene(scene(tmp_path, bent)).scene.quads
    assert quad.bend is not None
    assert (quad.bend.radius_m, quad.bend.axis) == (-0.2, "x")


def test_a_printed_sheet_hangs_with_its_markers_where_it_states_them(tmp_path: Path) -> None:
    (tmp_path / "result.json").write_text(json.dumps(SHEET))
    texture, size_m, marks = read_sheet(tmp_path)
    assert size_m == (0.21, 0.297)
    assert [mark.kind for mark in marks] == ["surf-dark", "surf-range-light"]
    assert marks[0].center_m == pytest.approx((-0.0447, 0.0778))
    x, y = (np.array([60.3, 70.7]) / (210, 297) * texture.size).tolist()
    side = 60 / 210 * texture.size[0]
    dark = 255.0 - texture.pixels[: texture.size[1] // 2 - 40, : texture.size[0] // 2 + 20]
    rows, columns = np.mgrid[: dark.shape[0], : dark.shape[1]]
    assert (dark * (columns + 0.5)).sum() / dark.sum() == pytest.approx(x, abs=0.01)
    assert (dark * (rows + 0.5)).sum() / dark.sum() == pytest.approx(y, abs=0.01)
    outside = np.maximum(abs(columns + 0.5 - x), abs(rows + 0.5 - y)) > side / 2 + 1
    assert (dark[outside] == 0).all()
    hung = load_scene(scene(tmp_path, f'[[sheets]]\nname = "s"\nfile = "result.json"\npage = 2\n{PAPER}')).scene.quads
    assert [(quad.name, [mark.name for mark in quad.marks]) for quad in hung] == [("s", ["s.m1"])]


@pytest.mark.parametrize("limit", ["energy", "range"])
def test_a_printed_sift_marker_is_the_shipped_pattern(limit: str, tmp_path: Path) -> None:
    printed = {"page": 1, "center_mm": [72, 84], "pattern": "sift", "side_mm": 72, "polarity": "light", "limit": limit}
    (tmp_path / "result.json").write_text(json.dumps({"page_mm": [144, 200], "markers": [printed]}))
    texture, _, (mark,) = read_sheet(tmp_path)
    assert mark.kind == ("sift-light" if limit == "energy" else "sift-range-light")
    pattern = read_image(ASSETS / "markers" / f"{mark.kind}.png")
    assert np.array_equal(texture.pixels[96:240, 72:216], pattern)


def test_a_mesh_stands_where_it_is_put(tmp_path: Path) -> None:
    trimesh.creation.box((1, 2, 3)).export(tmp_path / "box.stl")
    pose = "center_m = [1.0, 0.0, 0.0]\nrotation_deg = [0, 90, 90]\n"
    text = f'[[meshes]]\nname = "b"\nfile = "box.stl"\nscale = 0.1\nlevel = 30\n{pose}'
    (mesh,) = load_scene(scene(tmp_path, text)).scene.meshes
    assert np.allclose(mesh.triangles_m.reshape(-1, 3).mean(axis=0), [1, 0, 0])
    assert np.allclose(np.ptp(mesh.triangles_m, axis=(0, 1)), [0.2, 0.3, 0.1])
    assert mesh.skin is not None
    assert (mesh.skin.colors == 30).all()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (MARKER.replace("own.png", "none.png"), r"markers\[0\].kind: expected a file, 'none.png' is not in"),
        (MARKER.replace("own.png", "../none.png"), r"markers\[0\].kind: expected a path inside"),
        (MARKER.replace("own.png", "wide.png"), r"kind: expected a square image, got 20×10 in 'wide.png'"),
        (MARKER.replace("own.png", "scene.toml"), r"markers\[0\].kind: .*expected an image"),
        (MARKER.replace("own.png", "surf"), r"kind: expected one of .*surf-dark.* or an image file, got 'surf'"),
        (MARKER.replace("own.png", "surf-dark") + "bend_radius_m = 0.05\n", r"\[0\]: bend: radius_m: expected at"),
        ('[[meshes]]\nname = "a"\nfile = "no.glb"\n', r"meshes\[0\].file: expected a file, 'no.glb' is not in"),
        ('[[meshes]]\nname = "a"\nfile = "../no.glb"\n', r"meshes\[0\].file: expected a path inside"),
        ('[[meshes]]\nname = "a"\nfile = "scene.toml"\n', r"meshes\[0\].file: .*expected a file ending in glb"),
        ('[[meshes]]\nname = "a"\nfile = "a.glb"\nscale = -1.0\n', r"meshes\[0\].scale"),
        (f'[[sheets]]\nname = "s"\nfile = "no.json"\n{PAPER}', r"sheets\[0\].file: expected a file, 'no.json' is not"),
        (f'[[sheets]]\nname = "s"\nfile = "scene.toml"\n{PAPER}', r"sheets\[0\].file: .*the result.json of"),
        (f'[[sheets]]\nname = "s"\nfile = "s.json"\npage = 3\n{PAPER}', r"page: expected one with markers, got 3"),
    ],
)
def test_what_cannot_be_built_is_one_line_with_file_and_field(text: str, message: str, tmp_path: Path) -> None:
    Image.new("L", (20, 10)).save(tmp_path / "wide.png")
    (tmp_path / "s.json").write_text(json.dumps(SHEET))
    with pytest.raises(SceneError, match=message) as caught:
        load_scene(scene(tmp_path, text))
    assert str(caught.value).startswith(str(tmp_path / "scene.toml"))
    assert "\n" not in str(caught.value)
