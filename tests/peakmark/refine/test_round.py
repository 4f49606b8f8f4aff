"""Round patterns: the kernels against a drawing, derivatives against differences, centres of markers and of circles."""

from functools import partial

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from peakmark.errors import InputError
from peakmark.experiments.search.center_views import render_view
from peakmark.identification.alignment import lit_pattern
from peakmark.markers.patterns import Variant, dog_zero_crossing
from peakmark.markers.profile import MOST_RADII, sift_profile
from peakmark.refine import circle_centers, refine
from peakmark.refine.api import VARIANTS
from peakmark.refine.lit import lit_residuals
from peakmark.refine.round import ROUND_SPAN, round_shape_grid

KINDS = [Variant(polarity, limit, "sift") for polarity in ("dark", "light") for limit in ("energy", "range")]
FINE = 8
SHAPE = (96, 110)


def theta_of(blur: float = 0.6, g: tuple[float, float] = (0.05, -0.08), tone: float = 0.3) -> NDArray[np.float64]:
    """Return parameters of a pattern of about 40 px a unit, in a ramp of light, moved a little along a direction."""
    shape = [44.0, 6.0, 0.0, 30.0]
    return np.array([52.3, 47.6, *shape, *g, 150.0, 30.0, blur, 0.1, -0.05, 0.03, 0.02, tone, 0.2, -0.1])


def pixels() -> NDArray[np.int32]:
    y, x = np.mgrid[20:76, 20:86]
    return np.column_stack([x.ravel(), y.ravel()]).astype(np.int32)


def drawn(variant: Variant, theta: NDArray[np.float64], anchor: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return what a camera shows, by sampling eight times as fine and blurring that."""
    radii, _, levels = lit_pattern(variant)
    line = [(np.arange(length * FINE) + 0.5) / FINE - 0.5 for length in SHAPE[::-1]]
    x, y = np.meshgrid(*line)
    d = np.stack([x, y], axis=-1) - theta[:2]
    a = theta[2:6].reshape(2, 2)
    u = np.linalg.solve(a - d[..., :, None] * theta[6:8], d[..., None])[..., 0]
    exponent = np.exp(theta[15])
    shown = np.interp(
        np.hypot(*np.moveaxis(u, -1, 0)), radii, np.where((levels > 0) & (levels < 1), levels**exponent, levels)
    )
    wide = np.array([[theta[10] + theta[16], theta[17]], [theta[17], theta[10] - theta[16]]]) * FINE**2
    reach = np.arange(-30, 31)
    grid = np.stack(np.meshgrid(reach, reach), axis=-1)
    kernel = np.exp(-0.5 * np.einsum("yxi,ij,yxj->yx", grid, np.linalg.inv(wide), grid))
    soft = cv2.filter2D(shown, -1, kernel / kernel.sum(), borderType=cv2.BORDER_REPLICATE)
    seen = np.asarray(cv2.resize(soft, SHAPE[::-1], interpolation=cv2.INTER_AREA))
    yy, xx = np.mgrid[: SHAPE[0], : SHAPE[1]]
    p, q = (xx - anchor[0]) / anchor[2], (yy - anchor[1]) / anchor[2]
    light, shade = 1 + theta[11] * p + theta[12] * q, theta[13] * p + theta[14] * q
    return np.asarray(theta[9] + theta[8] * (light * seen + shade))


@pytest.mark.parametrize("variant", KINDS, ids=lambda one: one.kind)
def test_the_kernel_shows_what_a_drawing_shows(variant: Variant) -> None:
    theta, anchor = theta_of(), np.array([50.0, 45.0, 40.0])
    image = drawn(variant, theta, anchor).astype(np.float32)
    r, _ = lit_residuals(image, pixels(), theta, anchor, *lit_pattern(variant))
    assert np.abs(r).max() < 0.02 * theta[8]
    assert np.abs(r).mean() < 0.002 * theta[8]


@pytest.mark.parametrize("variant", KINDS, ids=lambda one: one.kind)
def test_derivatives_are_those_of_differences(variant: Variant) -> None:
    """All of them, with how shape and perspective change the blur; perspective's leave out a third order."""
    anchor = np.array([50.0, 45.0, 40.0])
    theta = theta_of(blur=1.5)
    show = partial(lit_residuals, np.zeros(SHAPE, np.float32), pixels(), anchor=anchor)
    lines, index, base = lit_pattern(variant, MOST_RADII)
    _, jacobian = show(theta=theta, lines=lines, index=index, base=base)
    steps = np.array([0.02, 0.02, *[0.3] * 4, 0.003, 0.003, 1.0, 1.0, *[0.02] * 8])
    tolerances = np.full(18, 0.12 if variant.is_disc else 0.01)
    tolerances[6:8] = 0.12
    for k in np.flatnonzero([not (variant.is_disc and k == 15) for k in range(18)]):  # a disc shows no tone
        step = steps[k] * np.eye(18)[k]
        up, down = (show(theta=theta + sign * step, lines=lines, index=index, base=base)[0] for sign in (1, -1))
        numeric = -(up - down) / (2 * steps[k])
        assert np.abs(jacobian[k] - numeric).max() < tolerances[k] * np.abs(numeric).max(), k


def test_shapes_of_the_coarse_search_leave_the_rotation_out() -> None:
    shapes = round_shape_grid()
    assert np.abs(shapes[:, 1, 0]).max() < 1e-12
    assert np.linalg.det(shapes).min() > 0


@pytest.mark.parametrize("variant", KINDS, ids=lambda one: one.kind)
@pytest.mark.parametrize("noise", [0.0, 2.0])
def test_refine_finds_the_centre(variant: Variant, noise: float) -> None:
    theta = theta_of(tone=0.0, g=(0.0, 0.0))
    theta[11:15] = theta[16:18] = 0
    image = drawn(variant, theta, np.array([50.0, 45.0, 40.0]))
    image = image + noise * np.random.default_rng(3).standard_normal(image.shape)
    gray = np.clip(np.rint(image), 0, 255).astype(np.uint8)
    side = np.sqrt(44.0 * 30.0) / ROUND_SPAN
    fit = refine(gray, (theta[:2] + np.array([1.0, -0.8]))[None], side * 1.1, variant.kind, focal_px=1e5)
    assert fit.converged[0]
    assert np.linalg.norm(fit.xy[0] - theta[:2]) < (0.05 if noise else 0.02)
    assert fit.side_px[0] == pytest.approx(side, rel=0.02)
    assert np.isfinite(fit.covariance).all()


def test_profiles_are_those_of_the_printed_marker() -> None:
    radii, levels = sift_profile("dark", "energy", 32)
    assert levels[0] == pytest.approx(0, abs=1e-3)
    assert np.diff(radii).min() > 0
    assert np.interp(dog_zero_crossing(1 / 12), radii, levels) == pytest.approx(levels[-1], abs=0.005)
    assert np.allclose(sift_profile("light", "energy", 32)[1], 1 - levels)
    edge, _ = sift_profile("dark", "range")
    assert edge.mean() == pytest.approx(dog_zero_crossing(1 / 12))


@pytest.mark.parametrize("tilt_deg", [5.0, 30.0, 60.0])
def test_one_of_two_centres_is_the_circles(tilt_deg: float) -> None:
    camera = np.array([[900.0, 0, 320], [0, 900.0, 240], [0, 0, 1]])
    t = np.radians(tilt_deg)
    turn = np.array([[1, 0, 0], [0, np.cos(t), -np.sin(t)], [0, np.sin(t), np.cos(t)]])
    homography = camera @ np.column_stack([0.05 * turn[:, :2], [0.1, -0.05, 0.6]])
    to_circle = np.linalg.inv(homography)
    conic = to_circle.T @ np.diag([1.0, 1.0, -1.0]) @ to_circle
    ellipse_center = np.linalg.solve(conic[:2, :2], -conic[:2, 2])
    size = conic[2, 2] - ellipse_center @ conic[:2, :2] @ ellipse_center
    affine = np.linalg.cholesky(np.linalg.inv(-conic[:2, :2] / size))
    true = homography[:2, 2] / homography[2, 2]
    both = circle_centers(ellipse_center, affine, camera)
    errors = np.linalg.norm(both - true, axis=1)
    assert errors.min() < 1e-6
    assert np.linalg.norm(ellipse_center - true) > 0.1


@pytest.mark.parametrize("kind", ["sift-range-dark", "sift-range-light"])
@pytest.mark.parametrize("side", [40, 150])
def test_a_discs_centre_is_at_one_of_two_places_which_its_covariance_holds(kind: str, side: float) -> None:
    rng = np.random.default_rng(int(side))
    squares = {"told": [], "guessed": []}
    for tilt_deg in (0.0, 20.0, 40.0, 60.0) * 3:
        seen = render_view(rng, VARIANTS[kind], side, tilt_deg)
        gray = seen.noisy(rng, 1.0)
        for name, focal in (("told", seen.focal_px), ("guessed", None)):
            fit = refine(gray, seen.center_xy[None] + 0.3, side, kind, focal_px=focal)
            error = fit.xy[0] - seen.center_xy
            squares[name].append(error @ np.linalg.solve(fit.covariance[0, :2, :2], error))
            if name == "told":
                assert min(np.linalg.norm(error + fit.aside[0]), np.linalg.norm(error - fit.aside[0])) < 0.03
    for each in squares.values():
        assert 0.4 < np.mean(each) < 4  # 2 are right; 12 of χ²(2) have a mean in 0.8…3.7 with 98 %


def test_of_patterns_that_show_their_perspective_the_centre_has_one_place() -> None:
    seen = render_view(np.random.default_rng(1), VARIANTS["sift-dark"], 60, 40)
    fit = refine(seen.noisy(np.random.default_rng(2), 0.0), seen.center_xy[None], 60.0, "sift-dark")
    np.testing.assert_array_equal(fit.aside, [[0.0, 0.0]])


def test_a_white_border_is_for_square_patterns() -> None:
    with pytest.raises(InputError, match=r"border: expected 0 with a round pattern, got 0\.1"):
        refine(np.zeros((50, 50), np.uint8), [[25.0, 25.0]], 30.0, "sift-dark", border=0.1)
