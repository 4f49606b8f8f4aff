import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from peakmark import surf
from peakmark.errors import InputError
from peakmark.experiments.detectability.conditions import KINDS, Condition, marker_pattern, motion_blurred, render_image


def darkness(image):
    return np.abs(image.astype(float) - float(image[0, 0]))


def centroid(weights):
    y, x = np.indices(weights.shape)
    return np.array([(weights * x).sum(), (weights * y).sum()]) / weights.sum()


@pytest.mark.parametrize("kind", KINDS)
def test_a_square_view_is_centred_where_truth_says(kind):
    view = render_image(Condition(kind, 60.0, image_px=129), np.random.default_rng(1))
    np.testing.assert_allclose(centroid(darkness(view.image)), view.center_xy, atol=0.05)
    np.testing.assert_allclose(view.blob_xy, view.center_xy, atol=1e-6)
    assert np.abs(view.center_xy - 64).max() <= 0.5
    assert view.side_px == pytest.approx(60, rel=1e-6)


def test_the_position_is_drawn_from_its_square():
    condition = Condition("surf-dark", 20.0, image_px=65, position_range_px=8.0)
    positions = np.array([render_image(condition, np.random.default_rng(seed)).center_xy for seed in range(60)]) - 32
    assert np.abs(positions).max() <= 4
    assert (positions.max(axis=0) > 3).all()
    assert (positions.min(axis=0) < -3).all()


@settings(max_examples=10)
@given(tilt=st.floats(0, 70), distance=st.floats(1.2, 20), seed=st.integers(0, 2**31))
def test_the_blob_centroid_is_that_of_the_dark_pixels_under_perspective(tilt, distance, seed):
    condition = Condition("sift-range-dark", 150.0, 257, tilt_deg=tilt, distance_sides=distance)
    view = render_image(condition, np.random.default_rng(seed))
    np.testing.assert_allclose(centroid(darkness(view.image)), view.blob_xy, atol=0.1)


def test_distance_decides_how_far_perspective_moves_the_blob():
    shifts = []
    for distance in (1.5, 3.0, 20.0):
        view = render_image(Condition(tilt_deg=50, distance_sides=distance), np.random.default_rng(2))
        shifts.append(np.linalg.norm(view.blob_xy - view.center_xy))
    assert shifts[0] > 2 * shifts[1] > 4 * shifts[2]


def test_the_same_stream_gives_the_same_image():
    condition = Condition(noise=10, motion_px=8, background="gravel", image_px=257)
    first, second = (render_image(condition, np.random.default_rng(3)).image for _ in range(2))
    np.testing.assert_array_equal(first, second)


def test_noise_blur_and_contrast_do_what_they_say():
    plain = render_image(Condition(turn_deg=0), np.random.default_rng(4)).image.astype(float)
    noisy = render_image(Condition(turn_deg=0, noise=8), np.random.default_rng(4)).image.astype(float)
    grey = (plain > 50) & (plain < 205)  # black and white cut the noise
    assert (noisy - plain)[grey].std() == pytest.approx(8, rel=0.03)
    faint = render_image(Condition(turn_deg=0, contrast=0.5), np.random.default_rng(4)).image.astype(float)
    np.testing.assert_allclose(faint, 127.5 + 0.5 * (plain - 127.5), atol=1.5)


@given(length=st.floats(0.5, 20), direction=st.floats(0, 180))
def test_motion_blur_spreads_a_point_along_its_line(length, direction):
    point = np.zeros((65, 65), np.float32)
    point[32, 32] = 1000
    streak = motion_blurred(point, length, direction)
    assert streak.sum() == pytest.approx(1000, rel=1e-4)
    np.testing.assert_allclose(centroid(streak), [32, 32], atol=0.01)
    y, x = np.indices(streak.shape) - 32.0
    c, s = np.cos(np.radians(direction)), np.sin(np.radians(direction))
    along = (streak * (c * x + s * y) ** 2).sum() / 1000
    assert along == pytest.approx(length**2 / 12, abs=0.35)


def test_a_photograph_is_behind_a_marker_with_a_white_cell_around():
    view = render_image(Condition(side_px=90, image_px=257, turn_deg=0, background="brick"), np.random.default_rng(5))
    x, y = np.rint(view.center_xy).astype(int)
    assert (view.image[y - 53 : y - 48, x - 40 : x + 40] > 250).all()
    assert view.image[:40].std() > 5


def test_marker_patterns_are_full_range():
    for kind in KINDS:
        assert (marker_pattern(kind).min(), marker_pattern(kind).max()) == (0, 255)


@pytest.mark.parametrize("changes", [{"marker": "orb"}, {"background": "sky"}, {"tilt_deg": 90.0}])
def test_unknown_conditions_are_refused(changes):
    with pytest.raises(InputError, match=r"expected .* got "):
        Condition(**changes)


def test_a_crop_shows_the_same_key_point_as_the_papers_image():
    crop, whole = (
        surf.detect(render_image(Condition(image_px=px), np.random.default_rng(6)).image, **surf.PAPER)[0]
        for px in (305, 513)
    )
    np.testing.assert_allclose(whole.xy - crop.xy, 104, atol=1e-3)
    assert whole.response == crop.response


def test_light_markers_answer_as_dark_ones_do():
    dark, light = (
        surf.detect(render_image(Condition(kind, 60.0, 129), np.random.default_rng(7)).image, **surf.PAPER)[0]
        for kind in ("surf-dark", "surf-light")
    )
    np.testing.assert_allclose(light.xy, dark.xy, atol=0.02)
    assert light.response[0] == pytest.approx(dark.response[0], rel=0.01)
    assert light.laplacian[0] == -dark.laplacian[0]


def test_contrast_on_a_photograph_fades_the_marker_alone():
    views = [
        render_image(Condition(side_px=90, image_px=257, contrast=c, background="grass"), np.random.default_rng(8))
        for c in (1.0, 0.2)
    ]
    x, y = np.rint(views[0].center_xy).astype(int)
    strong, faint = (view.image.astype(float) for view in views)
    np.testing.assert_array_equal(strong[:30], faint[:30])
    assert faint[y, x] == pytest.approx(127.5 + 0.2 * (strong[y, x] - 127.5), abs=1.5)
