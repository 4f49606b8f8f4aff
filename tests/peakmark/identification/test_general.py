"""The general search: clean markers at every phase, of every size, in bad light; and nothing where nothing is."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from peakmark.errors import InputError
from peakmark.identification.api import identify
from peakmark.identification.candidates import MarkerCandidates
from peakmark.identification.detection import Detection
from peakmark.identification.general import (
    BATCH,
    LEAST_ODDS,
    SCREENED_BATCH,
    _batches,
    _productive,
    _Rated,
    _screened,
    align_image,
    shipped_model,
)
from peakmark.identification.screening import BETTER, SCREEN_COLUMNS, shipped_screen
from peakmark.markers.optimum import Limit
from peakmark.markers.patterns import Polarity, Variant, surf_marker

ROWS, COLUMNS_PX = 240, 320
CENTER = np.array([160.0, 121.0])


def view(
    side_px: float = 34.0,
    polarity: Polarity = "dark",
    center: NDArray[np.float64] = CENTER,
    tilt_deg: float = 0.0,
    limit: Limit = "energy",
) -> NDArray[np.float64]:
    """Return linear levels 0…1 of a marker on white paper before grey, seen along a tilted normal, supersampled."""
    fine, texels = 4, 18 * 9
    sheet = np.pad(surf_marker(texels, polarity, limit), texels // 4, constant_values=255).astype(np.float64)
    turn = np.radians(20)
    spin = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    # the square root of the area is the side
    flat = np.diag([1.0, np.cos(np.radians(tilt_deg))]) / np.sqrt(np.cos(np.radians(tilt_deg)))
    linear = spin @ flat @ spin.T * (fine * side_px / texels)
    middle = (np.array(sheet.shape[::-1]) - 1) / 2
    shift = fine * (center + 0.5) - 0.5 - linear @ middle
    size = (fine * COLUMNS_PX, fine * ROWS)
    image = cv2.warpAffine(sheet, np.column_stack([linear, shift]), size, flags=cv2.INTER_AREA, borderValue=150.0)
    return np.asarray(cv2.resize(image, (COLUMNS_PX, ROWS), interpolation=cv2.INTER_AREA)) / 255


def as_image(levels: NDArray[np.float64], noise: float = 0.0, seed: int = 0) -> NDArray[np.uint8]:
    values = 40 + 170 * levels + np.random.default_rng(seed).normal(0, noise, levels.shape) * (noise > 0)
    return np.clip(np.rint(values), 0, 255).astype(np.uint8)


def found_at(found: tuple[Detection, ...], center: NDArray[np.float64], within_px: float) -> bool:
    return len(found) == 1 and bool(np.linalg.norm(found[0].xy - center) < within_px)


@pytest.mark.parametrize("polarity", ["dark", "light"])
@pytest.mark.parametrize("phase", [(0.0, 0.0), (0.5, 0.0), (0.5, 0.5), (0.25, 0.75)])
def test_a_clean_marker_is_found_at_every_phase(polarity: Polarity, phase: tuple[float, float]) -> None:
    center = CENTER + phase
    (detection,) = identify(as_image(view(34, polarity, center)))
    assert np.linalg.norm(detection.xy - center) < 0.05
    assert detection.polarity == polarity
    assert detection.size == pytest.approx(34, rel=0.02)
    assert detection.probability is not None
    assert detection.probability > shipped_model()[1]


@pytest.mark.parametrize("side_px", [14.0, 22.0, 60.0, 120.0, 150.0])
def test_markers_of_any_size_are_found(side_px: float) -> None:
    assert found_at(identify(as_image(view(side_px))), CENTER, 0.1)


def test_the_marker_in_the_middle_of_a_clean_even_image_is_found() -> None:
    image = np.full((200, 240), 180, np.uint8)
    image[60 - 30 : 60 + 30, 60 - 30 : 60 + 30] = 255
    image[60 - 24 : 60 + 24, 60 - 24 : 60 + 24] = surf_marker(48)
    assert found_at(identify(image), np.array([59.5, 59.5]), 0.05)


@pytest.mark.parametrize(("tilt_deg", "share"), [(0.0, 0.4), (0.0, 0.8), (45.0, 0.4), (45.0, 0.8), (68.0, 0.4)])
def test_a_ramp_of_light_over_the_marker_costs_nothing(tilt_deg: float, share: float) -> None:
    across = (np.arange(COLUMNS_PX) - CENTER[0]) / 34
    levels = view(34, tilt_deg=tilt_deg) * np.clip(1 - share / 2 + share * across, 0.1, 1.6)
    assert found_at(identify(as_image(levels, 1.0)), CENTER, 0.15)


@pytest.mark.parametrize("tilt_deg", [0.0, 45.0])
def test_a_shadow_edge_through_the_marker_is_no_reason_to_lose_it(tilt_deg: float) -> None:
    edge = 1 - 0.35 * (np.arange(COLUMNS_PX) > CENTER[0] + 4)
    assert found_at(identify(as_image(view(34, tilt_deg=tilt_deg) * edge, 1.0)), CENTER, 0.4)


@pytest.mark.parametrize("exponent", [0.6, 1.0, 1.5, 2.2])
@pytest.mark.parametrize("polarity", ["dark", "light"])
def test_a_tone_curve_changes_nothing(exponent: float, polarity: Polarity) -> None:
    found = identify(as_image(view(34, polarity) ** exponent, 1.0))
    assert found_at(found, CENTER, 0.1)
    assert found[0].polarity == polarity


@pytest.mark.parametrize(("noise", "expected"), [(6.0, 4), (12.0, 2), (16.0, 2)])
def test_noise_of_a_tenth_of_the_contrast_is_no_reason_either(noise: float, expected: int) -> None:
    hits = [found_at(identify(as_image(view(34), noise, seed)), CENTER, 0.6) for seed in range(4)]
    assert sum(hits) >= expected


@pytest.mark.parametrize(
    "image",
    [
        np.zeros((1, 1), np.uint8),
        np.full((300, 400), 200, np.uint8),
        np.full((40, 4000), 255, np.uint8),
        np.random.default_rng(0).integers(0, 256, (200, 300), dtype=np.uint8),
        np.random.default_rng(1).integers(0, 2, (200, 300), dtype=np.uint8) * np.uint8(255),
        np.asarray(cv2.GaussianBlur(np.random.default_rng(2).integers(0, 256, (200, 300), dtype=np.uint8), (0, 0), 4)),
    ],
    ids=["one pixel", "constant", "long", "noise", "one bit", "soft noise"],
)
def test_nothing_is_found_where_nothing_is(image: NDArray[np.uint8]) -> None:
    assert identify(image) == ()


def test_a_polarity_narrows_the_search() -> None:
    image = as_image(np.hstack([view(40), view(40, "light")]))
    assert [d.polarity for d in sorted(identify(image), key=lambda d: d.xy[0])] == ["dark", "light"]
    assert [d.polarity for d in identify(image, polarity="light")] == ["light"]
    assert [d.id for d in identify(image)] == [0, 1]


@pytest.mark.parametrize("tilt_deg", [0.0, 45.0])
@pytest.mark.parametrize("polarity", ["dark", "light"])
@pytest.mark.parametrize("limit", ["energy", "range"])
def test_both_limits_are_told_apart(limit: Limit, polarity: Polarity, tilt_deg: float) -> None:
    image = as_image(view(34, polarity, tilt_deg=tilt_deg, limit=limit), 2.0)
    for sought in ("both", limit):
        (detection,) = identify(image, limit=sought)  # type: ignore[arg-type]
        assert np.linalg.norm(detection.xy - CENTER) < 0.15
        assert (detection.polarity, detection.limit) == (polarity, limit)
        assert detection.covariance is not None
        assert 0 < np.sqrt(np.linalg.eigvalsh(detection.covariance)[-1]) < 0.1


def test_more_markers_than_are_aligned_at_once_are_all_found() -> None:
    sheet = np.pad(surf_marker(27), 8, constant_values=255)
    found = identify(np.pad(np.tile(sheet, (8, 12)), 12, constant_values=180))
    expected = {(43 * column + 33, 43 * row + 33) for row in range(8) for column in range(12)}
    assert len(found) == len(expected) > BATCH
    assert {tuple(np.rint(d.xy).astype(int).tolist()) for d in found} == expected


@pytest.mark.parametrize(("rank", "batches"), [(BATCH // 2 - 1, 1), (BATCH // 2, 2)])
def test_a_marker_late_in_a_batch_is_reason_for_one_more(rank: int, batches: int) -> None:
    found = align_image(as_image(view(), 1.0))
    late = replace(found, aligned=replace(found.aligned, rows=np.full(len(found.variants), rank)), tried=BATCH)
    whole = _productive(as_image(view(), 1.0), iter([(BATCH, iter([late, found, found]))]))
    assert len(whole.variants) == batches * len(found.variants)


def rated(odds: list[float], correlations: list[float], places: list[float]) -> _Rated:
    """Return candidates of 20 px at places along a line, with their correlations after the steps."""
    n = len(odds)
    xy, ones = np.column_stack([places, np.full(n, 50.0)]), np.ones(n)
    looks = np.full((n, len(SCREEN_COLUMNS)), np.nan)
    looks[:, BETTER] = correlations
    postures = np.column_stack([xy, np.tile([20.0, 0, 0, 20], (n, 1))])
    candidates = MarkerCandidates(xy, 20 * ones, ones.astype(np.int8), ones, ones)
    return _Rated(candidates, ones[:, None], looks, np.array(odds), postures)


def in_posture(candidates: _Rated, x: list[float]) -> _Rated:
    """Return candidates with the pattern at other places along the line."""
    postures = candidates.postures.copy()
    postures[:, 0] = x
    return replace(candidates, postures=postures)


def test_one_in_the_posture_of_a_sure_one_is_passed_over_and_the_likeliest_come_first() -> None:
    places = [50.0, 53.0, 80.0, 50.0]
    sure = in_posture(rated([1.0, 2.0, 3.0, -9.0], [0.95, 0.97, 0.97, 0.99], places), [50.5, 52.4, 80, 50])
    assert _screened(sure, np.arange(4), -5.0).tolist() == [2, 0]
    unsure = in_posture(rated([1.0, 2.0, 3.0, -9.0], [0.85, 0.97, 0.97, 0.99], places), [50.5, 52.4, 80, 50])
    assert _screened(unsure, np.arange(4), -5.0).tolist() == [2, 1, 0]
    apart = in_posture(rated([1.0, 2.0], [0.95, 0.97], [50, 53]), [50.5, 52.6])
    assert _screened(apart, np.arange(2), -5.0).tolist() == [1, 0]


def test_all_that_are_likely_are_aligned_at_once() -> None:
    image, n = as_image(view(), 1.0), 35 + SCREENED_BATCH
    odds = np.where(np.arange(n) < 30, LEAST_ODDS + 1, LEAST_ODDS - 1)
    candidates = rated(odds.tolist(), [0.9] * n, np.linspace(20, 300, n).tolist())
    batches = _batches(image, candidates, np.arange(n), (Variant("dark"),), 1.0, shipped_screen())
    assert [batch.tried for batch in batches] == [30, SCREENED_BATCH, 5]


def test_what_the_general_search_cannot_use_is_refused() -> None:
    image = as_image(view())
    with pytest.raises(InputError, match='stretch: expected none with rule "general"'):
        identify(image, stretch=2.0, rule="general")
    with pytest.raises(InputError, match='polarity: expected dark or light with rule "joint", got "both"'):
        identify(image, stretch=2.0, polarity="both")
    with pytest.raises(InputError, match="limit: expected one of energy, range, both, got 'foo'"):
        identify(image, limit="foo")  # type: ignore[arg-type]
