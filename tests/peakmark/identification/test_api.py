"""Both rules: every marker, nothing else; duplicates and ghosts never become markers."""

import cv2
import numpy as np
import pytest

from peakmark.errors import InputError
from peakmark.identification.api import Rule, identify
from peakmark.identification.detection import Detection
from peakmark.markers.patterns import surf_marker
from tests.helpers import marker_view
from tests.places import ROOT

both_rules = pytest.mark.parametrize("rule", ["paper", "joint"])


def floor_with_markers(centers: list[tuple[int, int]], side_px: int = 45) -> np.ndarray:
    """Return a low-contrast photograph with upright dark markers on white tiles pasted at whole pixels."""
    photo = cv2.imread(str(ROOT / "assets" / "textures" / "gravel.png"), cv2.IMREAD_GRAYSCALE)
    image = np.rint(150 + 0.5 * (photo.astype(float) - photo.mean())).astype(np.uint8)
    half = side_px * 5 // 8
    tile = marker_view(side_px, image_px=2 * half + 1)
    for x, y in centers:
        image[y - half : y + half + 1, x - half : x + half + 1] = tile
    return image


@both_rules
def test_all_markers_and_nothing_else_strongest_first(rule: Rule) -> None:
    centers = [(80, 90), (200, 120), (330, 100), (140, 300), (400, 380)]
    found = identify(floor_with_markers(centers), stretch=1.0, rule=rule)
    assert len(found) == len(centers)
    assert {min(centers, key=lambda c: float(np.hypot(*(d.xy - c)))) for d in found} == set(centers)
    assert max(min(np.hypot(*(d.xy - c)) for c in centers) for d in found) < 1.0
    responses = [d.response for d in found]
    assert responses == sorted(responses, reverse=True)
    assert [d.id for d in found] == list(range(5))
    assert all(d.polarity == "dark" and abs(d.size - 45) < 8 for d in found)


def test_the_paper_finds_light_markers_as_those_of_the_negative() -> None:
    image = floor_with_markers([(80, 90), (330, 300)])
    assert identify(255 - image, stretch=1.0, polarity="dark", rule="paper") == ()
    dark = identify(image, stretch=1.0, rule="paper", refine=False)
    light = identify(255 - image, stretch=1.0, polarity="light", rule="paper", refine=False)
    assert len(dark) == 2
    assert np.allclose([d.xy for d in dark], [d.xy for d in light], atol=0.02)


def test_light_and_dark_markers_on_white_paper_are_told_apart() -> None:
    image = floor_with_markers([(80, 90)])
    image[267:334, 297:364] = np.pad(surf_marker(45, "light"), 11, constant_values=255)
    for polarity, center in (("dark", (80, 90)), ("light", (330, 300))):
        found = identify(image, stretch=1.0, polarity=polarity)
        assert len(found) == 1
        assert np.allclose(found[0].xy, center, atol=0.05)


@pytest.mark.parametrize("is_refined", [False, True])
def test_the_papers_rule_finds_both_polarities_at_once_and_tells_them_by_the_laplacian(is_refined: bool) -> None:
    image = floor_with_markers([(80, 90), (330, 100)])
    image[267:334, 297:364] = np.pad(surf_marker(45, "light"), 11, constant_values=255)
    found = identify(image, polarity="both", rule="paper", refine=is_refined)
    told = sorted((d.polarity, *np.rint(d.xy).astype(int).tolist()) for d in found)
    assert told == [("dark", 80, 90), ("dark", 330, 100), ("light", 330, 300)]
    assert [d.id for d in found] == [0, 1, 2]
    assert all((d.affinity is not None) == is_refined for d in found)
    distances = {d.polarity: d.signature_distance for d in found}
    assert distances["dark"] < 0.2 < distances["light"] < 0.4  # from the version-independent signature, on white paper
    assert identify(np.full((300, 400), 77, np.uint8), polarity="both", rule="paper") == ()


@both_rules
def test_a_plain_image_has_no_markers(rule: Rule) -> None:
    assert identify(np.full((300, 400), 77, np.uint8), rule=rule) == ()


@both_rules
def test_stretching_finds_a_squashed_marker_where_it_is(rule: Rule) -> None:
    tall = floor_with_markers([(150, 200), (380, 300)])
    flat = cv2.resize(tall, None, fx=1, fy=0.5, interpolation=cv2.INTER_AREA)
    found = sorted(identify(flat, stretch=2.0, rule=rule), key=lambda d: float(d.xy[0]))
    expected = np.array([[150, (200.5 / 2) - 0.5], [380, (300.5 / 2) - 0.5]])
    assert np.allclose([d.xy for d in found], expected, atol=0.6)
    assert all(abs(d.size - 45 / np.sqrt(2)) < 6 for d in found)


def test_a_lone_marker_is_found_and_without_it_nothing() -> None:
    assert [d.xy.round().tolist() for d in identify(floor_with_markers([(200, 150)]), stretch=1.0)] == [[200, 150]]
    assert identify(floor_with_markers([]), stretch=1.0) == ()


def test_the_joint_rule_refines_centre_and_shape() -> None:
    found = identify(floor_with_markers([(200, 150), (340, 330)]), stretch=1.0)
    for detection, center in zip(sorted(found, key=lambda d: float(d.xy[0])), [(200, 150), (340, 330)], strict=True):
        assert np.allclose(detection.xy, center, atol=0.05)
        assert detection.affinity is not None
        assert np.allclose(np.linalg.svd(detection.affinity, compute_uv=False), 45, atol=0.5)
        assert detection.explained is not None
        assert detection.explained > 0.99


def test_a_lone_marker_on_plain_paper_is_found_at_its_centre() -> None:
    image = np.full((301, 401), 255, np.uint8)
    image[120:165, 230:275] = surf_marker(45)
    (found,) = identify(image, stretch=1.0)
    assert np.allclose(found.xy, [252, 142], atol=0.02)


@both_rules
def test_refining_can_be_left_out(rule: Rule) -> None:
    centers = [(80, 90), (330, 100), (140, 300)]
    image = floor_with_markers(centers)
    plain, fine = (identify(image, stretch=1.0, rule=rule, refine=choice) for choice in (False, True))
    assert [d.rank for d in plain] == [d.rank for d in fine]
    assert all(d.affinity is None and d.explained is None for d in plain)
    assert all(d.affinity is not None for d in fine)

    def worst(found: tuple[Detection, ...]) -> float:
        return max(min(float(np.hypot(*(d.xy - c))) for c in centers) for d in found)

    assert worst(fine) < 0.05 < worst(plain) < 1


@pytest.mark.parametrize("exposure", [0.3, 0.6])
def test_dim_light_changes_nothing(exposure: float) -> None:
    centers = [(80, 90), (330, 100), (140, 300)]
    dim = np.rint(exposure * floor_with_markers(centers)).astype(np.uint8)
    assert len(identify(dim, stretch=1.0)) == 3


@pytest.mark.parametrize("name", ["coins", "moon", "page"])
def test_photographs_hold_no_markers(name: str) -> None:
    from skimage import data

    assert identify(getattr(data, name)()) == ()


def test_an_unknown_rule_is_refused() -> None:
    image = np.zeros((40, 40), np.uint8)
    for polarity in ("dark", "light", "both"):
        with pytest.raises(InputError, match="limit: expected one of energy, range, both, got 'foo'"):
            identify(image, polarity=polarity, limit="foo")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="rule: expected one of general, joint, paper, got 'guess'"):
        identify(np.zeros((50, 50), np.uint8), rule="guess")  # type: ignore[arg-type]
