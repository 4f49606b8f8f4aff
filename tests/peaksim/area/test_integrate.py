"""The area integral against brute force, symmetries, and what can be derived by hand."""

import os

import numpy as np
import pytest
from peaksim import Camera, Quad, Scene, Texture
from peaksim.area.integrate import integrate
from peaksim.errors import InputError
from peaksim.geometry.pose import compose, rotation_about

from tests.peaksim.area.area_reference import area_integral
from tests.peaksim.shapes import plain_quad, plain_texture
from tests.peaksim.views import LENSES, random_view, through

CAMERA = Camera(width=48, height=48, fx=40.0, fy=40.0, cx=23.5, cy=23.5)
ABOVE = compose(np.diag([1.0, -1.0, -1.0]), [0, 0, 1.0])  # 1 m above z = 0, looking down, its x along the world's


def lying(z_m: float = 0.0, x_m: float = 0.0) -> np.ndarray:
    return compose(np.eye(3), [x_m, 0, z_m])


def errors(seed: int, samples: int, width: int, height: int) -> np.ndarray:
    view = random_view(seed, width, height)
    reference = area_integral(view.scene, view.camera, view.pose, samples)
    return np.abs(np.clip(np.rint(integrate(view.scene, view.camera, view.pose[None])), 0, 255) - reference)


@pytest.mark.parametrize("seed", [2, 5, 9, 12, 17])
def test_it_is_the_area_integral(seed: int) -> None:
    error = errors(seed, 32, 64, 48)
    assert np.sqrt((error**2).mean()) < 0.5
    assert np.quantile(error, 0.999) < 3


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(30))
def test_it_is_the_area_integral_from_thirty_random_poses(seed: int) -> None:
    error = errors(seed, 64, 160, 120)
    assert np.sqrt((error**2).mean()) < 0.5
    assert np.quantile(error, 0.999) < 3


def test_an_edge_covers_pixels_by_area() -> None:
    scene = Scene((plain_quad("white", 255, 0.5, lying()),), background=0.0)
    image = integrate(scene, CAMERA, ABOVE[None])[:, :, 0]
    # the quad's edges lie at 23.5 ± 10 px, in the middle between two pixel centres: whole pixels only
    assert set(np.unique(image)) == {0.0, 255.0}
    shifted = ABOVE.copy()
    shifted[0, 3] += 0.25 / 40  # a quarter of a pixel
    image = integrate(scene, CAMERA, shifted[None])[:, :, 0]
    assert image[24, 13] == pytest.approx(255 * 0.25, abs=1e-3)
    assert image[24, 33] == pytest.approx(255 * 0.75, abs=1e-3)
    assert image.sum() == pytest.approx(255 * 400, rel=1e-6)


@pytest.mark.parametrize("seed", range(5))
def test_a_rotation_of_the_camera_by_90_degrees_rotates_the_image_of_plain_quads_exactly(seed: int) -> None:
    view = random_view(seed, 48, 48)
    quads = tuple(
        Quad(q.name, plain_texture(20 + 30 * k), q.size_m, q.world_from_quad) for k, q in enumerate(view.scene.quads)
    )
    upright, rolled = quarter_turn(Scene(quads), view.pose)
    assert np.allclose(upright, rolled, atol=1e-4)
    assert np.array_equal(np.rint(upright), np.rint(rolled))


def test_a_quarter_turn_of_the_camera_turns_textures_within_their_error_budget() -> None:
    view = random_view(5, 48, 48)
    upright, rolled = quarter_turn(view.scene, view.pose)
    # steps along edges are shared by runs of pixels in a row, parts of pixels by bands of rows
    assert np.abs(np.rint(upright) - np.rint(rolled)).max() <= 1
    assert np.abs(upright - rolled).max() < 0.5
    assert np.sqrt(((upright - rolled) ** 2).mean()) < 0.1


def quarter_turn(scene: Scene, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the rotated image, and the image of the rotated camera."""
    rotated = pose @ compose(rotation_about("z", 90), np.zeros(3))
    return np.rot90(integrate(scene, CAMERA, pose[None]), 1), integrate(scene, CAMERA, rotated[None])


def test_overlapping_quads_hide_each_other_in_any_order() -> None:
    low, high = plain_quad("low", 50, 1.0, lying()), plain_quad("high", 250, 0.3, lying(0.2))
    quads = (low, plain_quad("middle", 150, 0.6, lying(0.1, 0.1)), high)
    images = [integrate(Scene(order), CAMERA, ABOVE[None]) for order in (quads, quads[::-1], quads[1:] + quads[:1])]
    assert np.allclose(images[0], images[1], atol=1e-4)
    assert np.allclose(images[0], images[2], atol=1e-4)


def test_intersecting_quads_are_split_where_they_meet() -> None:
    tilted = (rotation_about("y", angle) for angle in (20, -20))
    scene = Scene(
        tuple(
            plain_quad(str(k), level, 0.6, compose(r, np.zeros(3)))
            for k, (level, r) in enumerate(zip((0, 200), tilted, strict=True))
        )
    )
    image = integrate(scene, CAMERA, ABOVE[None])[24, 15:33, 0]
    assert list(np.unique(image[:9])) == [200.0] or list(np.unique(image[:9])) == [0.0]
    assert len(np.unique(image[9:])) == 1
    assert {image[0], image[-1]} == {0.0, 200.0}


def test_bytes_do_not_depend_on_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    view = random_view(8, 96, 72)
    images = []
    for threads in ("1", "2", "5"):
        monkeypatch.setenv("PEAKSIM_THREADS", threads)
        images.append(integrate(view.scene, view.camera, view.pose[None]).tobytes())
    assert images[0] == images[1] == images[2]
    assert os.environ["PEAKSIM_THREADS"] == "5"


@pytest.mark.parametrize("count", ["many", "-2", "1.5"])
def test_a_count_of_threads_that_is_none_is_refused(count: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PEAKSIM_THREADS", count)
    with pytest.raises(InputError, match=f"PEAKSIM_THREADS: expected a whole number of threads, got '{count}'"):
        integrate(Scene(), CAMERA, ABOVE[None])


@pytest.mark.parametrize("row", [28, 29, 30, 31])
def test_a_floor_that_ends_anywhere_in_a_band_of_rows_is_the_area_integral(row: int) -> None:
    chequer = Texture.from_array((np.indices((256, 256)) // 4).sum(axis=0).astype(np.uint8) % 2 * 255)
    camera = Camera(48, 48, 40.0, 40.0, 23.5, row - 2.0)
    pose = compose(rotation_about("x", -90), [0, 0, 0.5])  # level: the horizon is at cy, the floor ends 1.7 px below
    scene = Scene((Quad("floor", chequer, (24.0, 24.0), np.eye(4)),))
    error = np.rint(integrate(scene, camera, pose[None])) - area_integral(scene, camera, pose)
    assert np.sqrt((error**2).mean()) < 0.5


@pytest.mark.parametrize("lens", ["brown5", "fisheye"])
def test_what_a_lens_sees_is_the_area_integral(lens: str) -> None:
    assert rms_through(lens, 5, (64, 48)) < 0.7


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12))
def test_what_lenses_see_from_random_poses_is_the_area_integral(seed: int) -> None:
    assert rms_through(list(LENSES)[seed % len(LENSES)], seed, (120, 90)) < 0.7


def rms_through(lens: str, seed: int, size: tuple[int, int]) -> float:
    view = through(random_view(seed, *size), lens)
    reference = area_integral(view.scene, view.camera, view.pose, 32)
    error = np.rint(integrate(view.scene, view.camera, view.pose[None])) - reference
    return float(np.sqrt((error**2).mean()))
