"""Path-traced images against the exact renderer and against figures that can be derived."""

import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from peaksim import Camera, Light, Mesh, Quad, Scene, Texture, Trajectory, render
from peaksim.camera.camera import resized
from peaksim.camera.thin_lens import ThinLens
from peaksim.errors import SceneError
from peaksim.geometry.pose import compose, look_at, rotation_about
from peaksim.scene.lamps import AreaLight, Environment
from peaksim.scene.material import Material

from tests.peaksim.traced.helpers import assert_within_noise, needs_tracing
from tests.peaksim.views import LENSES
from tests.places import ROOT

pytestmark = needs_tracing

CAMERA = Camera(96, 72, 90.0, 90.0, 47.5, 35.5)
POSE = look_at([0.4, -1.5, 1.1], [0.0, 0.1, 0.1])
OVER = look_at([0, 0, 1], [0, 0, 0], up=(0, 1, 0))
ROLLING = replace(CAMERA, row_time_s=4e-4, exposure_s=8e-3)
CAMERAS = {
    "pinhole": CAMERA,
    **{name: resized(lens, CAMERA.width / lens.width) for name, lens in LENSES.items()},
    "equidistant": Camera(96, 72, 60.0, 60.0, 47.5, 35.5, model="fisheye"),
    "rolling": ROLLING,
    "rolling fisheye": replace(resized(LENSES["fisheye"], 0.15), row_time_s=4e-4, exposure_s=8e-3),
}
"""Every lens, and moving ones."""
WHITE = Texture.from_array(np.full((1, 1), 255, np.uint8))


def moving(pose: np.ndarray) -> Trajectory:
    """Return a path that passes a pose at 0.05 s, at 2 m/s sideways and 180 °/s."""
    ends = [pose @ compose(rotation_about("z", 9.0 * k), [0.1 * k, 0, 0]) for k in (-1, 1)]
    return Trajectory(np.array([0.0, 0.1]), np.stack(ends))


def view(camera: Camera, pose: np.ndarray = POSE) -> tuple[np.ndarray | Trajectory, float]:
    """Return what a camera is moved along, and the time of its image."""
    return (moving(pose), 0.05) if camera.row_time_s else (pose, 0.0)


def patterned() -> Scene:
    """Return an open scene: a floor, a card that stands on it, a box, and no light."""
    rng = np.random.default_rng(3)
    floor = Texture.from_array(rng.integers(0, 256, (24, 24), dtype=np.uint8))
    card = Texture.from_array(np.array([[0, 250, 0], [250, 40, 250]], np.uint8).repeat(8, 0).repeat(8, 1))
    standing = compose(rotation_about("z", 20) @ rotation_about("x", 70), [0.1, 0.2, 0.25])
    return Scene((Quad("floor", floor, (2.0, 2.0), np.eye(4)), Quad("card", card, (0.6, 0.4), standing)), (box(),))


def box(level: float = 90.0) -> Mesh:
    """Return a box of 0.2 m that stands on the floor."""
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * 0.2 + [-0.6, 0.1, 0.0]
    faces = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]]
    faces += [[2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
    return Mesh("box", corners, np.array(faces), color=(level,) * 3)


def rounds(scene: Scene, camera: Camera, samples: int, count: int = 4) -> np.ndarray:
    """Return (count, h, w, …) traced images of several seeds."""
    path, time_s = view(camera)
    images = [render(scene, camera, path, "traced", time_s, samples=samples, seed=k).linear for k in range(count)]
    return np.stack(images)


@pytest.mark.parametrize("name", CAMERAS)
def test_it_agrees_with_the_exact_renderer_through_every_camera(name: str) -> None:
    path, time_s = view(CAMERAS[name])
    expected = render(patterned(), CAMERAS[name], path, "exact", time_s).linear
    assert_within_noise(rounds(patterned(), CAMERAS[name], 64), expected, rms=0.5)


@pytest.mark.parametrize(
    "lights",
    [
        (Light("ambient", 0.7),),
        (Light("ambient", 0.2), Light("directional", 0.9, direction=(0.6, -0.4, -1.0))),
        (Light("point", 0.8, position_m=(0.3, -0.4, 1.8), reference_m=1.5),),
        (Light("point", 0.8, position_m=(0.3, -0.4, 1.8), casts_shadows=False), Light("directional", 0.3)),
    ],
    ids=["ambient", "directional", "point", "without shadows"],
)
def test_direct_light_and_shadow_are_those_of_the_exact_renderer(lights: tuple[Light, ...]) -> None:
    # a black box, seen as black, throws shadows and no light; the card would throw shadows here and not in "exact"
    scene = Scene(patterned().quads[:1], (box(0.0),), lights)
    expected = render(scene, CAMERA, POSE, "exact").linear
    assert_within_noise(rounds(scene, CAMERA, 64), expected, rms=0.5)


def test_an_even_sky_over_open_ground_is_ambient_light() -> None:
    ground = patterned().quads[:1]
    expected = render(Scene(ground, background=255.0), CAMERA, POSE, "exact").linear
    assert_within_noise(rounds(Scene(ground, lights=(Environment(1.0),)), CAMERA, 64), expected, rms=0.5)


def test_a_coloured_scene_is_traced_in_colour() -> None:
    tiles = np.random.default_rng(0).integers(0, 256, (8, 8, 3), dtype=np.uint8)
    scene = Scene((Quad("floor", Texture.from_array(tiles), (2.0, 2.0), np.eye(4)),))
    expected = render(scene, CAMERA, POSE, "exact").linear
    assert expected.shape == (72, 96, 3)
    assert_within_noise(rounds(scene, CAMERA, 32), expected, rms=0.5)


# --- energy -----------------------------------------------------------------------------------------------------


def test_in_a_white_furnace_everything_is_white() -> None:
    floor = Quad("floor", WHITE, (2.0, 2.0), np.eye(4))
    open_ground = Scene((floor,), lights=(Environment(1.0),))
    linear = render(open_ground, CAMERA, POSE, "traced", samples=16).linear
    assert linear.mean() / 255 == pytest.approx(1.0, abs=0.002)
    with_box = Scene((floor,), (box(255.0),), (Environment(1.0),))
    linear = render(with_box, CAMERA, look_at([0, -0.9, 0.6], [0, 0, 0.1]), "traced", samples=64, max_depth=1000).linear
    assert linear.mean() / 255 == pytest.approx(1.0, abs=0.002)  # light that bounces to and fro comes out whole
    assert linear.std() > 0


def test_a_wall_before_an_endless_lamp_reflects_its_share() -> None:
    # a wall of albedo ρ before an endless lamp of radiance E, which is black, shows ρ·E: nothing comes back from black
    low, high = (
        render(
            Scene((Quad("w", WHITE, (40, 40), np.eye(4), material=Material(reflectance=(0.0, albedo))),), (), (lamp,)),
            Camera(9, 9, 90.0, 90.0, 4.0, 4.0),
            look_at([0.05, 0, 0.1], [0, 0, 0]),
            "traced",
            samples=1024,
        ).linear.mean()
        for lamp in [AreaLight((0, 0, 0.3), (40, 40), 0.9)]
        for albedo in (0.25, 0.5)
    )
    assert (low, high) == pytest.approx((0.25 * 0.9 * 255, 0.5 * 0.9 * 255), rel=0.005)


# --- light that can be calculated -----------------------------------------------------------------------------------


def test_light_of_a_lamp_is_that_of_the_form_factor() -> None:
    # Lambert's formula for a point under the middle of a parallel rectangle of half sides a, b at height h
    a, b, h, radiance = 0.3, 0.2, 0.8, 2.0
    quarter = [(x / np.hypot(h, x)) * np.arctan(y / np.hypot(h, x)) for x, y in ((a, b), (b, a))]
    multiplier = radiance * 4 * sum(quarter) / (2 * np.pi)
    scene = Scene(
        (Quad("floor", WHITE, (4, 4), np.eye(4)),), (), (AreaLight((0, 0, h + 1e-3), (2 * a, 2 * b), radiance),)
    )
    close = Camera(9, 9, 400.0, 400.0, 4.0, 4.0)
    beside = look_at([0.6, 0, 0.5], [0, 0, 0])
    levels = render(scene, close, beside, "traced", samples=4096).linear
    assert levels.mean() == pytest.approx(255 * multiplier, rel=0.005)


@pytest.mark.parametrize("distance_m", [2.0, 4.0])
def test_a_small_lamp_fades_with_the_square_of_the_distance(distance_m: float) -> None:
    side, radiance = 0.05, 900.0
    scene = Scene(
        (Quad("floor", WHITE, (9, 9), np.eye(4)),), (), (AreaLight((0, 0, distance_m), (side, side), radiance),)
    )
    frame = render(scene, Camera(9, 9, 400.0, 400.0, 4.0, 4.0), look_at([1, 0, 1], [0, 0, 0]), "traced", samples=1024)
    expected = 255 * radiance * side**2 / (np.pi * distance_m**2)
    assert frame.linear.mean() == pytest.approx(expected, rel=0.01)


def test_the_edge_of_a_shadow_is_where_the_light_is_cut() -> None:
    # a half plane at height z shades from a strip lamp at height h: across the penumbra the lit share is linear
    h, z, half = 2.0, 1.0, 0.1
    corners = np.array([[-3, -3, z], [0, -3, z], [0, 3, z], [-3, 3, z]], dtype=float)
    roof = Mesh("roof", corners, np.array([[0, 1, 2], [0, 2, 3]]), color=(0.0,) * 3)
    floor = Quad("floor", WHITE, (8, 8), np.eye(4))
    lamp = AreaLight((0, 0, h + 1e-3), (2 * half, 2 * half), 100.0)
    camera = Camera(120, 16, 240.0, 240.0, 59.5, 7.5)
    below = look_at([0, -0.4, 0.6], [0, 0, 0])
    lit, shaded = (
        render(Scene((floor,), meshes, (lamp,)), camera, below, "traced", samples=1024).linear.mean(axis=0)
        for meshes in ((), (roof,))
    )
    # the pixels' x on the floor, in the row through its middle
    x = (np.arange(120) - 59.5) / 240.0 * np.hypot(0.4, 0.6)
    # the floor point x sees of the lamp what lies beyond the line from x over the roof's edge (x = 0)
    share = np.clip(0.5 + x * (h - z) / z / (2 * half), 0, 1)
    assert np.abs(shaded / lit - share).max() < 0.03
    assert not shaded[x < -half - 0.01].any()
    assert np.interp(0.5, shaded / lit, x) == pytest.approx(0.0, abs=1e-3)


def test_a_highlight_lies_where_the_mirror_shows_the_lamp() -> None:
    sheet = Quad("sheet", WHITE, (4, 4), np.eye(4), material=Material("plastic", (0.0, 0.1), roughness=0.02))
    lamp = AreaLight((0.2, 1.5, 1.2), (0.04, 0.04), 200.0, (0, -1.5, -1.2))
    eye = np.array([0.0, -1.0, 1.0])
    camera = Camera(96, 72, 90.0, 90.0, 47.5, 35.5)
    pose = look_at(eye, [0.0, 0.1, 0.0])
    linear = render(Scene((sheet,), lights=(lamp,)), camera, pose, "traced", samples=256).linear
    mirrored = np.array([0.2, 1.5, -1.2])
    met = eye + (mirrored - eye) * eye[2] / (eye[2] - mirrored[2])
    expected = camera.project((met - eye)[None] @ pose[:3, :3])[0]
    bright = np.where(linear > 0.5 * linear.max(), linear, 0)
    y, x = np.indices(linear.shape)
    centroid = np.array([(x * bright).sum(), (y * bright).sum()]) / bright.sum()
    assert np.linalg.norm(centroid - expected) < 0.3
    dull = replace(sheet, material=Material("diffuse", (0.0, 0.1)))
    assert render(Scene((dull,), lights=(lamp,)), camera, pose, "traced").linear.max() < 0.2 * linear.max()


def test_the_surroundings_stand_the_right_way_round() -> None:
    image = np.zeros((64, 128), np.float32)
    image[:32] = np.arange(128) / 127  # above the horizon, brighter to the right
    image[:3] = 0.9  # straight up

    def level(to: tuple[float, float, float], yaw_deg: float = 0.0) -> float:
        sky = Scene(lights=(Environment(1.0, image, yaw_deg),))
        pose = look_at((0, 0, 0), to, up=(0, 0, 1) if to[0] or to[1] else (0, 1, 0))
        return float(render(sky, Camera(5, 5, 200.0, 200.0, 2.0, 2.0), pose, "traced").linear.mean() / 255)

    assert level((0, 1, 0.2)) == pytest.approx(0.5, abs=0.01)
    assert level((1, 0, 0.2)) == pytest.approx(0.75, abs=0.01)
    assert level((-1, 0, 0.2)) == pytest.approx(0.25, abs=0.01)
    assert level((1, 0, -0.2)) == 0
    assert level((0, 0, 1)) == pytest.approx(0.9, abs=0.01)
    assert level((-1, 0, 0.2), yaw_deg=90.0) == pytest.approx(0.5, abs=0.01)


# --- geometry -----------------------------------------------------------------------------------------------------


def crop(camera: Camera, middle_px: tuple[int, int], side: int = 32) -> Camera:
    """Return the camera's pixels around a position."""
    left, top = middle_px[0] - side // 2, middle_px[1] - side // 2
    return replace(camera, width=side, height=side, cx=camera.cx - left, cy=camera.cy - top)


BLOB_CAMERAS = {
    "pinhole": Camera(),
    **LENSES,
    "equidistant": Camera(fx=330.0, fy=330.0, model="fisheye"),
    "rolling": Camera(row_time_s=4e-5, exposure_s=2e-3),
    "rolling fisheye": replace(LENSES["fisheye"], row_time_s=4e-5, exposure_s=2e-3),
}


def area_and_centroid(xy: np.ndarray) -> tuple[float, np.ndarray]:
    """Return the area and the centroid of a polygon of (n, 2) corners."""
    following = np.roll(xy, -1, axis=0)
    crosses = xy[:, 0] * following[:, 1] - xy[:, 1] * following[:, 0]
    return abs(crosses.sum()) / 2, ((xy + following) * crosses[:, None]).sum(axis=0) / (3 * crosses.sum())


@pytest.mark.parametrize("name", BLOB_CAMERAS)
@pytest.mark.parametrize("middle_px", [(330, 200), (110, 90), (560, 420)])
def test_blobs_lie_where_the_camera_projects_their_centres(name: str, middle_px: tuple[int, int]) -> None:
    camera = crop(BLOB_CAMERAS[name], middle_px)
    n = np.arange(129) - 64.0
    disc = np.where(np.hypot(*np.meshgrid(n, n)) < 56, 0, 255).astype(np.uint8)
    path, time_s = view(camera, OVER)
    ray = camera.unproject([[15.8, 15.3]])[0]
    towards = OVER[:3, :3] @ (ray / np.linalg.norm(ray))
    # a disc of 8 px that faces the camera
    facing = look_at(OVER[:3, 3], OVER[:3, 3] + towards, up=(0, 1, 0))[:3, :3] @ np.diag([1.0, -1.0, -1.0])
    side_m = 9.0 / camera.fx
    blob = Quad("blob", Texture.from_array(disc), (side_m, side_m), compose(facing, OVER[:3, 3] + towards), "disc")
    frame = render(Scene((blob,), background=255.0), camera, path, "traced", time_s, samples=2048)
    weight = 255.0 - frame.linear.astype(np.float64)
    y, x = np.indices(weight.shape)
    centroid = np.array([(x * weight).sum(), (y * weight).sum()]) / weight.sum()
    angle = np.linspace(0, 2 * np.pi, 512, endpoint=False)
    rim = 56 / 129 * side_m * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    outline = rim @ facing.T + blob.world_from_quad[:3, 3]
    moments = frame.posed_camera.moments(16) if camera.exposure_s else (frame.posed_camera,)
    areas, centres = zip(*(area_and_centroid(moment.project(outline)) for moment in moments), strict=True)
    assert weight.sum() / 255 == pytest.approx(np.mean(areas), rel=0.01)
    assert np.linalg.norm(centroid - np.average(centres, axis=0, weights=areas)) < 0.02


def test_a_thin_lens_blurs_what_is_out_of_focus_by_its_circle_of_confusion() -> None:
    edge = Texture.from_array(np.array([[0, 255]], np.uint8).repeat(64, 1))
    camera = Camera(96, 8, 100.0, 100.0, 47.5, 3.5)
    away = look_at([0, 0, 2.0], [0, 0, 0], up=(0, 1, 0))
    scene = Scene((Quad("edge", edge, (4, 4), np.eye(4)),))

    def width_px(focus_m: float) -> float:
        lens = replace(camera, thin_lens=ThinLens(focus_m, 0.2))
        rise = np.diff(render(scene, lens, away, "traced", samples=1024).linear.mean(axis=0))
        x = np.arange(len(rise))
        middle = (x * rise).sum() / rise.sum()
        return float(np.sqrt(((x - middle) ** 2 * rise).sum() / rise.sum()))

    # a disc of diameter d has a standard deviation of d/4 along an axis
    expected = 0.2 * abs(2.0 - 1.0) / (2.0 * 1.0) * camera.fx / 4
    assert width_px(1.0) == pytest.approx(expected, rel=0.06)
    assert width_px(2.0) < 1.0


def test_of_quads_in_one_plane_the_later_one_is_seen() -> None:
    black = Texture.from_array(np.zeros((1, 1), np.uint8))
    tilted = compose(rotation_about("x", 30) @ rotation_about("y", 20), [0, 0, 0])
    scene = Scene(tuple(Quad(f"q{k}", (WHITE, black)[k % 2], (9.0, 9.0), tilted) for k in range(4)))
    assert not render(scene, CAMERA, OVER, "traced", samples=16).image.any()


# --- the same again -------------------------------------------------------------------------------------------------

_HASHES = """
import hashlib, numpy as np
from tests.peaksim.traced.test_integrate import CAMERA, POSE, AreaLight, Scene, patterned, render
p = patterned()
lamps = AreaLight((0, 0, 1.5), (0.4, 0.4), 9.0), AreaLight((1, 0, 1.5), (0.4, 0.4), 5.0, (-1, 0, -1))
scene = Scene(p.quads, p.meshes, lamps)
for seed in (0, 0, 1, (1, 2)):
    print(hashlib.sha256(render(scene, CAMERA, POSE, "traced", samples=8, seed=seed).linear.tobytes()).hexdigest())
"""


def test_the_same_seed_gives_the_same_bytes_in_every_process() -> None:
    paths = {"PYTHONPATH": f"{ROOT / 'src'}:{ROOT / 'sim'}:{ROOT}"}
    runs = [
        subprocess.run(
            [sys.executable, "-c", _HASHES], env={**os.environ, **paths, "PEAKSIM_THREADS": threads},
            capture_output=True, text=True, check=True,
        ).stdout.split()
        for threads in ("1", "2")
    ]  # fmt: skip
    assert runs[0] == runs[1]
    assert runs[0][0] == runs[0][1]
    assert len(set(runs[0])) == 3


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"samples": 0}, r"samples: expected a whole number in 1…1000000, got 0"),
        ({"samples": 2.5}, r"samples: expected a whole number"),
        ({"max_depth": 1}, r"max_depth: expected a whole number in 2…10000, got 1"),
        ({"seed": -1}, r"seed: expected a whole number ≥ 0, or several, got -1"),
    ],
)
def test_bad_arguments_are_refused_in_one_line(arguments: dict[str, float], message: str) -> None:
    with pytest.raises(SceneError, match=message):
        render(Scene(), CAMERA, POSE, "traced", **arguments)  # type: ignore[arg-type]


def test_an_empty_scene_is_its_background() -> None:
    assert (render(Scene(background=77.0), CAMERA, POSE, "traced", samples=4).image == 77).all()
