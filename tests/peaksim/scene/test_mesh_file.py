"""Meshes from files: what they show, which way is up, and what is refused."""

import io
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from peaksim import Camera, Mesh, Scene
from peaksim.area.integrate import integrate
from peaksim.errors import InputError, SceneError
from peaksim.geometry.pose import look_at
from peaksim.scene.mesh_file import read_mesh
from PIL import Image

QUARTERS = np.array([[[255, 0, 0], [0, 200, 0]], [[0, 0, 255], [90, 90, 90]]], np.uint8).repeat(8, 0).repeat(8, 1)
"""An image: red and green above blue and grey."""
SQUARE_M = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])
"""Upright where y is up, seen from +z."""
UV = np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]])
FACES = np.array([[0, 1, 2], [0, 2, 3]])


def square(uv: np.ndarray | None = UV, image: np.ndarray = QUARTERS, **material: Any) -> trimesh.Trimesh:
    made = trimesh.visual.material.PBRMaterial(baseColorTexture=Image.fromarray(image), **material)
    visual = trimesh.visual.TextureVisuals(uv=uv, material=made)
    return trimesh.Trimesh(SQUARE_M, FACES, visual=visual, process=False)


def write(mesh: Any, path: Path) -> Path:
    mesh.export(path)
    return path


def levels_seen(mesh: Mesh, normal: tuple[float, float, float], up: tuple[float, float, float]) -> np.ndarray:
    """Return the (2, 2, 3) levels at the middles of the quarters of a square of 1 m, from before it."""
    middle = (mesh.triangles_m.max(axis=(0, 1)) + mesh.triangles_m.min(axis=(0, 1))) / 2
    camera = Camera(40, 40, 40.0, 40.0, 19.5, 19.5)
    pose = look_at(middle + np.array(normal) * 1.001, middle, up)
    shown = integrate(Scene((), (mesh,)), camera, pose[None])
    return shown[10::20, 10::20].repeat(3 // shown.shape[2], axis=2)


@pytest.mark.parametrize("kind", ["glb", "gltf", "obj"])
def test_images_are_the_right_way_up(kind: str, tmp_path: Path) -> None:
    folder = tmp_path / kind
    folder.mkdir()
    mesh = Mesh.from_file(write(square(), folder / f"sign.{kind}"), up="y")
    assert mesh.name == "sign"
    assert np.allclose(levels_seen(mesh, (0, -1, 0), (0, 0, 1)), QUARTERS[4::8, 4::8], atol=0.01)


def test_y_is_up_in_gltf_and_z_in_other_formats(tmp_path: Path) -> None:
    standing, lying = (Mesh.from_file(write(square(), tmp_path / name)) for name in ("a.glb", "a.obj"))
    assert np.allclose(standing.triangles_m.max(axis=(0, 1)), [1, 0, 1])
    assert np.allclose(lying.triangles_m.max(axis=(0, 1)), [1, 1, 0])
    assert np.allclose(levels_seen(lying, (0, 0, 1), (0, 1, 0)), QUARTERS[4::8, 4::8], atol=0.01)


@pytest.mark.parametrize("kind", ["ply", "stl", "obj", "glb"])
def test_meshes_without_images_have_colours_or_the_given_one(kind: str, tmp_path: Path) -> None:
    box = trimesh.creation.box((1, 2, 3))
    plain = Mesh.from_file(write(box, tmp_path / f"plain.{kind}"), color=(10, 20, 30), up="z", scale=0.1)
    assert np.allclose(np.ptp(plain.triangles_m, axis=(0, 1)), [0.1, 0.2, 0.3])
    assert len(plain.faces) == 12
    assert plain.skin is not None
    if kind != "glb":  # trimesh writes a white material of its own
        assert (plain.skin.colors == [10, 20, 30]).all()
    if kind != "stl":
        box.visual.vertex_colors = np.arange(24, dtype=np.uint8).reshape(8, 3) * 10
        skin = Mesh.from_file(write(box, tmp_path / f"colored.{kind}"), up="z").skin
        assert skin is not None
        assert skin.colors is not None
        shares = np.unique(skin.colors.reshape(-1, 3), axis=0) / 255
        linear = np.arange(24).reshape(8, 3) * 10 / 255
        coded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
        assert np.allclose(shares, coded if kind == "glb" else linear, atol=1e-6)


def test_a_factor_of_gltf_multiplies_its_image_as_light(tmp_path: Path) -> None:
    mesh = Mesh.from_file(write(square(baseColorFactor=[0.5, 1.0, 0.25, 1.0]), tmp_path / "a.glb"))
    assert mesh.skin is not None
    red, green, blue, grey = mesh.skin.textures[0].pixels[4::8, 4::8].reshape(4, 3).tolist()
    assert (red, green, blue) == ([188, 0, 0], [0, 200, 0], [0, 0, 137])
    assert grey[1] == 90


def test_repeated_images_go_on_without_a_seam(tmp_path: Path) -> None:
    ramp = np.tile(np.array([0, 80, 160, 240], np.uint8), (4, 1))
    mesh = Mesh.from_file(write(square(3 * UV - 0.5, ramp), tmp_path / "a.glb"))
    camera = Camera(48, 48, 48.0, 48.0, 23.5, 23.5)
    shown = integrate(Scene((), (mesh,)), camera, look_at([0.5, -1, 0.5], [0.5, 0, 0.5])[None])[24, :, 0]
    u = 4 * (3 * (np.arange(48) + 0.5) / 48 - 0.5) % 4
    left = np.floor(u - 0.5).astype(int)
    expected = ramp[0, left % 4] + (u - 0.5 - left) * (ramp[0, (left + 1) % 4] - ramp[0, left % 4].astype(float))
    assert np.abs(shown[1:-1] - expected[1:-1]).max() < 0.01


def test_poses_of_nodes_and_mirrored_parts_are_applied(tmp_path: Path) -> None:
    scene = trimesh.Scene()
    moved = trimesh.transformations.translation_matrix([0, 0, 5])
    mirrored = np.diag([-1.0, 1, 1, 1])
    for k, matrix in enumerate((moved, mirrored)):
        scene.add_geometry(trimesh.creation.box((1, 1, 1)), node_name=f"n{k}", transform=matrix)
    mesh = Mesh.from_file(write(scene, tmp_path / "a.glb"))
    outward = np.cross(*(mesh.triangles_m[:, k] - mesh.triangles_m[:, 0] for k in (1, 2)))
    middles = np.where(mesh.triangles_m[:, :1, 1] < -2, [[0, -5, 0]], [[0, 0, 0]])
    assert ((outward * (mesh.triangles_m.mean(axis=1) - middles)).sum(axis=1) > 0).all()
    assert mesh.triangles_m[..., 1].min() == pytest.approx(-5.5)


def test_lines_are_dropped_and_that_is_said(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "a.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 2 0 0\nv 0 1 0\nf 1 2 3\nf 1 1 4\nf 1 2 4\n")
    assert len(Mesh.from_file(path).faces) == 1
    assert capfd.readouterr().err == f"peaksim: {path}: left out 2 faces without area\n"


def gltf(**changes: Any) -> bytes:
    """Return the glTF text of one triangle, with fields replaced."""
    data = struct.pack("<9f", 0, 0, 0, 1, 0, 0, 0, 1, 0)
    header = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "bufferViews": [{"buffer": 0, "byteOffset": 0, "byteLength": 36}],
        "buffers": [{"byteLength": 36, "uri": "data:application/octet-stream;base64," + _base64(data)}],
    }
    return json.dumps(header | changes).encode()


def _base64(data: bytes) -> str:
    import base64

    return base64.b64encode(data).decode()


def stl(faces: int) -> bytes:
    return bytes(80) + struct.pack("<I", faces) + np.zeros(faces * 50, np.uint8).tobytes()


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.gltf", gltf(buffers=[{"byteLength": 36, "uri": "no.bin"}]), "uri: expected a file, 'no.bin' is not in"),
        ("a.gltf", gltf(images=[{"uri": "no%20image.png"}]), "uri: expected a file, 'no image.png' is not in"),
        ("a.gltf", gltf(images=[{"uri": "../../secret.png"}]), "uri: expected a path inside"),
        ("a.gltf", gltf(images=[{"uri": "/etc/passwd"}]), "uri: expected a path inside"),
        ("a.gltf", gltf(extensionsRequired=["KHR_draco_mesh_compression"]), "without required extensions, got 'KHR_dr"),
        ("a.gltf", gltf(nodes=[]), "expected triangles, got none|damaged"),
        ("a.gltf", gltf(accessors=[]), "damaged|expected triangles"),
        ("a.gltf", b"[]", "expected glTF 2.0, found none"),
        ("a.gltf", b"{", "expected glTF 2.0, found none"),
        ("a.glb", b"glTF", "expected glTF 2.0, found none"),
        ("a.obj", b"mtllib no.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "expected a file, 'no.mtl' is not"),
        ("a.obj", b"nothing", "expected triangles, got none|damaged"),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nv nan 1 0\nf 1 2 3\n", "expected finite positions|damaged"),
        ("a.ply", b"ply\nformat ascii 1.0\nelement vertex x\n", "damaged"),
        ("a.stl", b"", "damaged|expected triangles"),
        ("a.stl", stl(1_000_001), "expected at most 1000000 faces, got 1000001; simplify the mesh"),
        ("a.dae", b"", "expected a file ending in glb, gltf, obj, ply, stl, got 'a.dae'"),
        ("no.glb", None, "cannot be read: No such file"),
    ],
)
def test_what_cannot_be_read_is_one_line(name: str, content: bytes | None, message: str, tmp_path: Path) -> None:
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(SceneError, match=message) as caught:
        read_mesh(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_a_glTF_file_of_one_triangle_is_read(tmp_path: Path) -> None:
    path = tmp_path / "a.gltf"
    path.write_bytes(gltf())
    assert np.allclose(read_mesh(path).corners, [[[0, 0, 0], [1, 0, 0], [0, 0, 1]]])
    assert read_mesh(path, up="z").corners[0, 2, 1] == 1


def eps() -> bytes:
    stream = io.BytesIO()
    Image.fromarray(QUARTERS).save(stream, "EPS")
    return stream.getvalue()


@pytest.mark.parametrize("content", [b"no image", eps()], ids=["none", "a program"])
@pytest.mark.parametrize("kind", ["obj", "gltf", "glb"])
def test_images_that_are_none_are_refused(kind: str, content: bytes, tmp_path: Path) -> None:
    path = write(square(), tmp_path / f"a.{kind}")
    if kind == "obj":
        (tmp_path / "material_0.png").write_bytes(content)
    else:
        whole = gltf(
            images=[{"mimeType": "image/png", "uri": "data:image/png;base64," + _base64(content)}],
            textures=[{"source": 0}],
            materials=[{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
            meshes=[{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "material": 0}]}],
            accessors=[
                {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
                {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC2"},
            ],
        )
        whole += b" " * (-len(whole) % 4)
        chunk = struct.pack("<II", len(whole), 0x4E4F534A) + whole
        path.write_bytes(whole if kind == "gltf" else struct.pack("<4sII", b"glTF", 2, 12 + len(chunk)) + chunk)
    with pytest.raises(InputError, match=r"expected an image"):
        read_mesh(path)


@pytest.mark.parametrize("scale", [0, -1, float("nan"), float("inf"), "1"])
def test_scales_that_are_not_positive_are_refused(scale: Any, tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"a.glb: scale: expected a positive number"):
        Mesh.from_file(write(square(), tmp_path / "a.glb"), scale=scale)
