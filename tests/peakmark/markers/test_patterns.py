import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from peakmark import marker
from peakmark.errors import InputError
from peakmark.markers.optimum import linear_optimum, quadratic

sides = st.integers(9, 200)
polarities = st.sampled_from(["dark", "light"])
limits = st.sampled_from(["energy", "range"])


@pytest.mark.parametrize("kernel_side", [9, 15, 18, 21, 27, 30, 60, 195])
def test_surf_optimum_is_the_sum_of_gxx_and_gyy(kernel_side):
    gxx, gyy, _ = marker.surf_filters(kernel_side)
    expected = (gxx + gyy) / np.linalg.norm(gxx + gyy)
    np.testing.assert_allclose(marker.surf_optimum(kernel_side), expected, atol=1e-12)


def test_eigenvalues_of_section_3_2():
    filters = marker.surf_filters(9).reshape(3, 81)
    values = np.linalg.eigvalsh(2 * filters.T @ marker.surf_form(1.0) @ filters)
    np.testing.assert_allclose(values[[-1, 1, 0]], [0.471111, -0.328889, -0.888889], atol=1e-6)
    np.testing.assert_allclose(values[2:-1], 0, atol=1e-12)


def test_surf_filters_at_side_15_are_those_of_opencv():
    gxx, _, gxy = marker.surf_filters(15)
    assert (gxx[7].nonzero()[0] == np.arange(15)).all()
    assert np.unique(gxx.nonzero()[0]).tolist() == list(range(3, 12))
    assert np.unique(gxy.nonzero()[0]).tolist() == [2, 3, 4, 5, 6, 8, 9, 10, 11, 12]


@pytest.mark.parametrize("side", [-9, 0, 3, 8, 10, 12, 24, 25, 48])
def test_kernel_sides_that_surf_does_not_have_are_refused(side):
    with pytest.raises(InputError, match=rf"kernel_side.*got {side}$"):
        marker.surf_filters(side)


def test_grey_levels_of_the_surf_marker():
    assert np.unique(marker.surf_cells()).tolist() == [0, 128, 170, 212, 255]
    assert np.unique(marker.surf_cells("light")).tolist() == [0, 43, 85, 127, 255]
    assert np.unique(marker.surf_cells(limit="range")).tolist() == [0, 255]
    assert (marker.surf_cells()[[0, 2, 2, 4, 0], [0, 2, 3, 4, 4]] == [170, 255, 128, 0, 212]).all()


def test_range_limited_surf_marker_gains_1_85_in_determinant():
    filters, form = marker.surf_filters(9), marker.surf_form()
    best = marker.surf_optimum(9)
    stretched = 255 * (best - best.min()) / np.ptp(best)
    assert quadratic(stretched, filters, form) == pytest.approx(90200, rel=1e-4)
    assert quadratic(marker.surf_cells(limit="range").astype(float), filters, form) == pytest.approx(166464)


@given(side=sides, polarity=polarities, limit=limits)
def test_surf_marker_is_symmetric_and_keeps_the_mean_level(side, polarity, limit):
    image = marker.surf_marker(side, polarity, limit)
    assert image.dtype == np.uint8
    assert image.shape == (side, side)
    for mirrored in (image.T, image[::-1], image[:, ::-1]):
        np.testing.assert_array_equal(image, mirrored)
    assert image.mean() == pytest.approx(marker.surf_cells(polarity, limit).mean(), abs=0.5)


@pytest.mark.parametrize("limit", ["energy", "range"])
@pytest.mark.parametrize("polarity", ["dark", "light"])
def test_surf_marker_of_whole_cells_is_its_cells(polarity, limit):
    cells = marker.surf_cells(polarity, limit)
    np.testing.assert_array_equal(marker.surf_marker(9, polarity, limit), cells)
    np.testing.assert_array_equal(marker.surf_marker(45, polarity, limit), np.kron(cells, np.ones((5, 5))))


@given(side=sides)
def test_surf_marker_is_the_area_mean_of_a_fine_drawing(side):
    fine = np.kron(marker.surf_cells(), np.ones((side, side)))
    mean = fine.reshape(side, 9, side, 9).mean(axis=(1, 3))
    assert np.abs(marker.surf_marker(side) - mean).max() <= 0.5 + 1e-6


def test_dark_has_a_dark_centre_and_light_is_its_negative():
    for make in (marker.surf_marker, lambda **kw: marker.sift_marker(side_px=147, **kw)):
        for limit in ("energy", "range"):
            dark, light = make(polarity="dark", limit=limit), make(polarity="light", limit=limit)
            assert dark[73, 73] == 0
            assert light[73, 73] == 255
            assert np.abs(dark.astype(int) + light - 255).max() <= 1


def test_sift_marker_is_a_stretched_dog():
    r2 = np.add.outer((np.arange(181) - 90.0) ** 2, (np.arange(181) - 90.0) ** 2)
    wide, narrow = 15.0 * 2 ** (1 / 3), 15.0
    dog = np.exp(-r2 / (2 * wide**2)) / wide**2 - np.exp(-r2 / (2 * narrow**2)) / narrow**2
    expected = 255 * (dog - dog.min()) / (dog.max() - dog.min())
    assert np.abs(marker.sift_marker() - expected).max() < 1


def test_range_limited_sift_marker_is_the_disc_where_the_dog_is_negative_and_gains_1_68():
    signs = linear_optimum(marker.dog(15.0, 181), "range").x
    disc = marker.sift_marker(limit="range")
    settled = (disc == 0) | (disc == 255)
    np.testing.assert_array_equal(np.where(disc[settled] == 0, -1, 1), signs[settled])
    weights = marker.dog(15.0, 181)
    weights -= weights.mean()
    gain = (weights * disc).sum() / (weights * marker.sift_marker()).sum()
    assert gain == pytest.approx(1.68, abs=0.02)


@settings(deadline=None)
@given(radius=st.floats(1.0, 30.0), side=st.integers(9, 80))
def test_disc_shares_are_areas(radius, side):
    shares = marker.disc_shares(radius, side)
    assert shares.min() > -1e-9
    assert shares.max() < 1 + 1e-9
    if radius <= side / 2:
        assert shares.sum() == pytest.approx(np.pi * radius**2)
    fine = (np.arange(side * 16) + 0.5) / 16 - side / 2
    inside = np.add.outer(fine**2, fine**2) <= radius**2
    assert np.abs(shares - inside.reshape(side, 16, side, 16).mean(axis=(1, 3))).max() < 0.1


def test_sift_key_point_lies_at_the_centre_of_both_sift_markers():
    detector = cv2.SIFT_create(enable_precise_upscale=True)
    for limit, sigma in (("energy", 15 / np.sqrt(2)), ("range", 15.0)):
        image = marker.sift_marker(limit=limit)
        found = cv2.copyMakeBorder(image, 166, 166, 166, 166, cv2.BORDER_REPLICATE)
        best = max(detector.detect(found, None), key=lambda k: k.response)
        assert np.hypot(best.pt[0] - 256, best.pt[1] - 256) < 0.05
        assert best.size / 2 == pytest.approx(sigma, rel=0.12)


def test_texture_has_whole_cells_and_a_white_border():
    texture = marker.surf_texture("dark", cell_px=16)
    assert texture.shape == (176, 176)
    assert (texture[:16] == 255).all()
    np.testing.assert_array_equal(texture[24:-16:16, 24:-16:16], marker.surf_cells())


@pytest.mark.parametrize(
    "call",
    [
        lambda: marker.surf_marker(8),
        lambda: marker.surf_marker(20.5),
        lambda: marker.surf_marker(True),
        lambda: marker.surf_marker(1_000_000),
        lambda: marker.surf_marker(polarity="grey"),
        lambda: marker.surf_marker(limit="power"),
        lambda: marker.sift_marker(sigma_px=float("nan")),
        lambda: marker.sift_marker(sigma_px=100.0, side_px=181),
    ],
)
def test_bad_input_is_named(call):
    with pytest.raises(InputError, match=r"expected .* got "):
        call()
