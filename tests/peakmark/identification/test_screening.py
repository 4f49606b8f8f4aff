"""The screen: postures come to the truth, views show the cells, markers pass and plain blobs do not."""

import numpy as np
import pytest
from numpy.typing import NDArray

from peakmark.experiments.search.grounds import DRAWN, draw_ground
from peakmark.identification.alignment import lit_template
from peakmark.identification.candidates import MarkerCandidates
from peakmark.identification.general import align_image
from peakmark.identification.screening import (
    SCREEN_COLUMNS,
    VIEWED,
    has_screen,
    screen_columns,
    shipped_screen,
    slopes_of,
)
from peakmark.markers.patterns import Polarity, Variant
from peakmark.refine.align import softened
from peakmark.refine.posture import view_candidates
from tests.peakmark.identification.test_general import CENTER, as_image, view

Values = NDArray[np.float64]


def posture_of(center: Values, shape: Values) -> Values:
    return np.concatenate([center, shape.reshape(-1)])[None]


@pytest.mark.parametrize("seed", range(8))
def test_a_few_steps_bring_the_pattern_to_within_a_hundredth_of_its_side(seed: int) -> None:
    rng = np.random.default_rng(seed)
    side, variant = float(rng.uniform(14, 60)), Variant("dark" if seed % 2 else "light")
    center = CENTER + rng.uniform(-0.5, 0.5, 2)
    image = as_image(view(side, variant.polarity, center))
    turn = np.radians(20 + rng.uniform(-7, 7))
    spin = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    off = posture_of(center + 0.05 * side * rng.uniform(-1, 1, 2), side * rng.uniform(0.9, 1.1) * spin)
    samples, template = lit_template(variant)
    postures, scores, _ = view_candidates(
        image, center[None], np.array([side]), off, samples, template, slopes_of(variant), VIEWED
    )
    assert np.linalg.norm(postures[0, :2] - center) < 0.01 * side
    assert np.sqrt(np.linalg.det(postures[0, 2:].reshape(2, 2))) == pytest.approx(side, rel=0.05)
    assert scores[0] > 0.95


def sampled(image: Values, center: Values, shape: Values, points: Values) -> Values:
    """Return levels (m,) bilinear at points of a pattern, as the kernel takes them."""
    x, y = (center + points @ shape.T).T
    x, y = np.clip(x, 0, image.shape[1] - 1.001), np.clip(y, 0, image.shape[0] - 1.001)
    left, top = x.astype(int), y.astype(int)
    right, down = x - left, y - top
    upper = image[top, left] * (1 - right) + image[top, left + 1] * right
    lower = image[top + 1, left] * (1 - right) + image[top + 1, left + 1] * right
    return np.asarray(upper * (1 - down) + lower * down)


def test_the_kernel_takes_the_steps_of_plain_numpy() -> None:
    image = np.random.default_rng(4).integers(0, 256, (26, 30), dtype=np.uint8)
    image[8:20, 9:21] = as_image(view(12))[115:127, 154:166]
    center, size, variant = np.array([14.6, 13.7]), 12.0, Variant("dark")
    start = posture_of(center, np.array([[11.0, 2.0], [-3.0, 12.0]]))
    samples, template = lit_template(variant)
    slopes = slopes_of(variant)
    found, scores, views = view_candidates(
        image, center[None], np.array([size]), start, samples, template, slopes, VIEWED
    )
    soft, here, shape, best = softened(image.astype(np.float32)).astype(np.float64), start[0, :2], start[0, 2:], None
    shape = shape.reshape(2, 2)
    for _ in range(5):
        levels = sampled(soft, here, shape, samples)
        flat = levels - levels.mean()
        spread = (samples[:, 0] ** 2).sum()
        ramps = [(flat @ samples[:, k]) ** 2 / spread for k in (0, 1)]
        score = levels @ template / np.sqrt(flat @ flat - sum(ramps))
        best = (score, here, shape) if best is None or score > best[0] else best
        offset = np.clip(slopes @ levels / (levels @ template), [-0.1] * 2 + [-0.25] * 4, [0.1] * 2 + [0.25] * 4)
        here, shape = here - shape @ offset[:2], shape @ (np.eye(2) - offset[2:].reshape(2, 2))
    assert best is not None
    assert np.allclose(found[0], posture_of(best[1], best[2])[0], atol=1e-3)
    assert scores[0] == pytest.approx(best[0], abs=1e-4)
    assert np.allclose(views[0], sampled(soft, best[1], best[2], VIEWED), atol=0.1)


@pytest.mark.parametrize("polarity", ["dark", "light"])
@pytest.mark.parametrize("side", [16.0, 34.0, 90.0])
def test_a_marker_looks_like_one_and_passes(polarity: Polarity, side: float) -> None:
    turn = np.radians(20)
    spin = side * np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    sign = np.array([1 if polarity == "dark" else -1], np.int8)
    one = MarkerCandidates(CENTER[None], np.array([side]), sign, np.array([9e3]), np.array([0.7]))
    image = as_image(view(side, polarity))
    look, _ = screen_columns(image, one, posture_of(CENTER, spin), np.array([0.93]), Variant(polarity), 1.0)
    columns = dict(zip(SCREEN_COLUMNS, look[0], strict=True))
    assert columns["template"] > 0.95
    assert columns["ring_1"] > 0.7  # the softened edge of light markers reaches over the ring
    assert columns["one_sided"] < 0.02
    assert shipped_screen().before.trees.sums(look)[0] > shipped_screen().before.least


def test_much_that_resembles_a_marker_on_drawn_grounds_is_stopped() -> None:
    gate, stopped, count = shipped_screen().before, 0, 0
    for kind in DRAWN:
        ground = draw_ground(kind, np.random.default_rng(5), 256)
        looks = align_image(ground).looks
        stopped += int((gate.trees.sums(looks) < gate.least).sum())
        count += len(looks)
    assert count > 50
    assert stopped > 0.2 * count


def test_only_the_markers_of_the_paper_are_screened() -> None:
    others = (Variant("dark", "range"), Variant("dark", "energy", "sift"))
    assert [has_screen(variant) for variant in (Variant("dark"), *others)] == [True, False, False]
