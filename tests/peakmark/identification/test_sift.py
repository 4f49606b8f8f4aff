"""The search for SIFT markers: every kind at every size in one image, with SURF's, as arrays; and what is refused."""

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from peakmark.arrays.decode import decode_arrays
from peakmark.errors import InputError
from peakmark.identification.api import identify
from peakmark.identification.detection import Detection
from peakmark.identification.families import surf_disc_pages
from peakmark.identification.sift_candidates import blur, dog_extremes, sift_candidate_pages, sift_worth
from peakmark.identification.sift_features import shared_distances
from peakmark.identification.sift_signature import (
    SIGNATURE,
    key_sigma,
    reference_sift_descriptor,
    sift_signature_distances,
    upright_descriptors,
)
from peakmark.markers.array_code import THREE_BIT, polarities_of
from peakmark.markers.patterns import SIFT_SIDE_IN_SIGMA, Polarity, Variant, marker_image
from tests.peakmark.identification.sift_wall import KINDS, wall


def found_at(found: tuple[Detection, ...], xy: NDArray[np.float64]) -> Detection:
    (one,) = (d for d in found if np.linalg.norm(d.xy - xy) < 8)
    return one


def test_dogs_and_discs_of_both_polarities_are_found_as_what_they_are() -> None:
    image, truth = wall()
    found = identify(image, detector="sift", limit="both")
    assert len(found) == len(truth)
    for kind, xy, side in truth:
        one = found_at(found, xy)
        assert one.kind == kind.kind
        assert np.linalg.norm(one.xy - xy) < 0.1
        assert one.size == pytest.approx(side, rel=0.1)


def test_one_limit_is_asked_for_and_the_other_not_found_by_name() -> None:
    image, _ = wall()
    assert {d.limit for d in identify(image, detector="sift")} == {"energy"}
    assert {d.kind for d in identify(image, detector="sift", polarity="light", limit="range")} == {"sift-range-light"}


def test_markers_of_both_detectors_in_one_image() -> None:
    kinds = (Variant("dark"), Variant("light"), Variant("dark", "energy", "sift"), Variant("light", "energy", "sift"))
    image, truth = wall(kinds)
    found = identify(image, detector=("surf", "sift"))
    assert [d.id for d in found] == [0, 1, 2, 3]
    assert {found_at(found, xy).kind for _, xy, _ in truth} == {kind.kind for kind in kinds}


def test_a_signature_tells_the_marker_from_others() -> None:
    image, _ = wall()
    found = identify(image, detector="sift")
    assert max(d.signature_distance for d in found) < 0.3
    noise = np.random.default_rng(0).random((20, 128))
    assert sift_signature_distances(noise, (KINDS[0],) * 20).min() > 0.3
    assert len(SIGNATURE) == 32


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.kind)
def test_extremes_have_the_sign_of_the_centre_and_the_scale_of_the_marker(kind: Variant) -> None:
    side = 120
    image = np.pad(marker_image(side, kind), 60, mode="edge")
    points = dog_extremes(image)
    x, y, sigma, response = points[np.argmax(np.abs(points[:, 3]))]
    assert np.hypot(x - 119.5, y - 119.5) < sigma / 2
    assert np.sign(response) == (1 if kind.polarity == "dark" else -1)
    own = side / SIFT_SIDE_IN_SIGMA / (np.sqrt(2) if kind.limit == "energy" else 1)
    assert sigma == pytest.approx(own, rel=0.07)


@pytest.mark.parametrize("sigma", [0.52, 0.635, 0.8, 1.0, 1.6])
def test_narrow_blurs_are_as_wide_as_they_should_be(sigma: float) -> None:
    point = np.zeros((21, 21), np.float32)
    point[10, 10] = 1
    shown = np.empty_like(point)
    blur(point, 0.5, sigma, shown)
    line = shown.sum(axis=0)
    assert line.sum() == pytest.approx(1, rel=1e-5)
    assert (line * (np.arange(21) - 10) ** 2).sum() == pytest.approx(sigma**2 - 0.25, rel=0.07, abs=1e-3)


@pytest.mark.parametrize("polarity", ["dark", "light"])
@pytest.mark.parametrize("side_px", [16, 20])
def test_small_markers_are_candidates_under_a_tone_curve(side_px: int, polarity: Polarity) -> None:
    fine = np.pad(marker_image(15 * side_px, Variant(polarity, "energy", "sift")), 15 * 20, constant_values=255)
    shown = cv2.resize(fine, None, fx=1 / 15, fy=1 / 15, interpolation=cv2.INTER_AREA)
    image = np.rint(255 * (0.1 + 0.7 * shown / 255) ** (1 / 2.2)).astype(np.uint8)
    page = next(sift_candidate_pages(image))
    middle = (len(image) - 1) / 2
    near = np.linalg.norm(page.xy - middle, axis=1) < 0.1 * side_px
    assert (page.signs[near] == (1 if polarity == "dark" else -1)).any()


def test_candidates_come_by_what_their_answers_are_worth() -> None:
    image, _ = wall()
    page = next(sift_candidate_pages(image))
    worth = sift_worth(page.responses, page.quotients)
    assert (np.diff(worth) <= 1e-12).all()
    strong, faint = sift_worth(np.array([0.04, 0.02]), np.array([0.9, 0.9]))
    assert strong - faint == pytest.approx(0.03)


def test_small_descriptors_are_those_of_the_whole_image() -> None:
    """OpenCV's, of key points for which it doubles an image: parts of it serve."""
    image, truth = wall()
    sides = np.array([24.0] * len(truth))
    xy, variants = np.array([xy for _, xy, _ in truth]), tuple(kind for kind, _, _ in truth)
    found = upright_descriptors(image, xy, sides, variants)
    points = [
        cv2.KeyPoint(float(x), float(y), 2 * float(key_sigma(24.0, kind)), 0.0, 1.0, 255 | 2 << 8)
        for (x, y), kind in zip(xy, variants, strict=True)
    ]
    _, whole = cv2.SIFT_create(enable_precise_upscale=True).compute(image, points)  # type: ignore[attr-defined]
    is_same_layer = np.array([kind.limit == "energy" for kind in variants])
    off = np.abs(found - whole)[is_same_layer].max(axis=1)
    assert off.max() <= 8  # of 255


def test_an_empty_image_has_none() -> None:
    assert identify(np.full((200, 300), 128, np.uint8), detector="sift") == ()


@pytest.mark.parametrize("code", range(8))
def test_arrays_of_sift_markers_are_read(code: int) -> None:
    bits = polarities_of(code, THREE_BIT)
    paper = np.full((300, 300), 255, np.uint8)
    for (column, row), polarity in zip(THREE_BIT.cells, bits, strict=True):
        top, left = 60 + round(96 * row), 60 + round(96 * column)
        paper[top : top + 72, left : left + 72] = marker_image(72, Variant(polarity, "energy", "sift"))
    image = np.rint(40 + 0.7 * paper + np.random.default_rng(code).normal(0, 1.5, paper.shape)).astype(np.uint8)
    (array,) = decode_arrays(identify(image, detector="sift"), image=image)
    assert (array.code, array.doubt) == (code, "")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"detector": "orb"}, "detector: expected one of surf, sift, vlfeat, surf-disc, got 'orb'"),
        ({"detector": ()}, "detector: expected some of surf, sift, vlfeat, surf-disc, got none"),
        ({"detector": "sift", "rule": "joint"}, 'detector: expected surf with rule "joint", got sift'),
        ({"detector": "vlfeat", "rule": "paper"}, 'detector: expected surf or sift with rule "paper", got vlfeat'),
    ],
)
def test_what_is_no_detector_is_refused(arguments: dict[str, object], message: str) -> None:
    with pytest.raises(InputError) as error:
        identify(np.zeros((50, 60), np.uint8), **arguments)  # type: ignore[arg-type]
    assert str(error.value) == message


def test_surf_finds_what_it_found_before() -> None:
    image, _ = wall((Variant("dark"), Variant("light")) * 2)
    assert [d.kind for d in identify(image)] == [d.kind for d in identify(image, detector=["surf"])]


@pytest.mark.parametrize("is_refined", [False, True])
def test_the_papers_rule_takes_sifts_strongest_features_with_its_signature(is_refined: bool) -> None:
    image = np.full((520, 560), 225, np.uint8)  # the grey of a DoG's rim
    image[260:] = 255 - 225
    image[180:260] = np.random.default_rng(1).integers(90, 160, (80, 560))  # clutter
    places = {"dark": [(60, 60), (300, 90)], "light": [(180, 370), (430, 380)]}
    for polarity, corners in places.items():
        for x, y in corners:
            image[y : y + 72, x : x + 72] = marker_image(72, Variant(polarity, "energy", "sift"))  # type: ignore[arg-type]
    noisy = np.rint(30 + 0.75 * image + np.random.default_rng(0).normal(0, 2, image.shape)).astype(np.uint8)
    found = identify(noisy, detector="sift", rule="paper", polarity="both", refine=is_refined)
    told = sorted((d.kind, *np.rint(d.xy - 35.5).astype(int).tolist()) for d in found)
    assert told == sorted((f"sift-{polarity}", x, y) for polarity, corners in places.items() for x, y in corners)
    assert all((d.affinity is not None) == is_refined for d in found)
    assert max(d.signature_distance for d in found) < 0.25


def test_light_and_dark_markers_share_the_sums_of_opposite_directions() -> None:
    descriptors = np.array([reference_sift_descriptor(Variant(p, "energy", "sift")) for p in ("dark", "light")])
    assert shared_distances(descriptors.astype(np.float32)).max() < 0.02
    variant = Variant("dark", "energy", "sift")
    assert sift_signature_distances(descriptors, (variant, variant))[1] > 1


def test_a_disc_is_found_where_surf_answers_too_and_has_one_name() -> None:
    image, truth = wall((Variant("dark", "range", "sift"), Variant("light", "range", "sift")) * 4)
    by_sift, by_surf = identify(image, detector="sift", limit="range"), identify(image, detector="surf-disc")
    for found in (by_sift, by_surf):
        assert {found_at(found, xy).kind for _, xy, _ in truth} == {"sift-range-dark", "sift-range-light"}
        assert len(found) == len(truth)
    with pytest.raises(InputError, match="limit: expected range or both with the detector surf-disc"):
        identify(image, detector="surf-disc", limit="energy")


@pytest.mark.parametrize("side", [60, 144])
def test_surf_tells_the_side_of_a_disc_by_its_scale(side: int) -> None:
    image = np.pad(marker_image(side, Variant("dark", "range", "sift")), side, constant_values=255)
    page = next(surf_disc_pages(image))
    middle = np.linalg.norm(page.xy - (len(image) - 1) / 2, axis=1) < side / 20
    best = np.flatnonzero(middle)[np.argmax(page.quotients[middle])]
    assert page.sides_px[best] / np.sqrt(2) == pytest.approx(side, rel=0.12)


@pytest.mark.parametrize("side", [16, 20])
@pytest.mark.parametrize("polarity", ["dark", "light"])
def test_discs_below_surfs_smallest_filter_are_found_in_the_enlarged_image(side: int, polarity: Polarity) -> None:
    fine = np.pad(marker_image(8 * side, Variant(polarity, "range", "sift")), 16 * side, constant_values=255)
    image = cv2.resize(fine, None, fx=1 / 8, fy=1 / 8, interpolation=cv2.INTER_AREA)
    (found,) = identify(image, detector="surf-disc")
    assert found.kind == f"sift-range-{polarity}"
    assert np.linalg.norm(found.xy - (5 * side - 1) / 2) < 0.05
