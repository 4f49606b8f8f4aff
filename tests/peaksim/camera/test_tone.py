"""Tone curves: against their standard, their points, and each other."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from peaksim.camera.tone import CURVES, check_tone, coded
from peaksim.errors import SceneError
from peaksim.scene.material import linear_from_srgb

SHARES = np.linspace(0, 1, 2001, dtype=np.float32)


def test_srgb_is_the_inverse_of_its_decoding() -> None:
    assert np.allclose(linear_from_srgb(coded(SHARES, "srgb")), SHARES, atol=1e-6)


def test_linear_is_what_comes_in() -> None:
    assert np.array_equal(coded(SHARES, "linear"), SHARES)


def test_the_s_curve_has_darker_shadows_and_brighter_lights_than_srgb() -> None:
    difference = coded(SHARES, "s-curve") - coded(SHARES, "srgb")
    assert (difference[(SHARES > 0.005) & (SHARES < 0.25)] < 0).all()
    assert (difference[(SHARES > 0.35) & (SHARES < 0.95)] > 0).all()
    assert coded([0.1, 0.5], "s-curve") == pytest.approx([0.270, 0.758], abs=1e-5)


@pytest.mark.parametrize("tone", [*CURVES, ((0, 0.1), (0.2, 0.5), (1, 0.9))])
def test_every_curve_rises_and_clips(tone: object) -> None:
    checked = check_tone(tone, "tone")
    values = coded(SHARES, checked)
    assert (np.diff(values) >= 0).all()
    assert coded([-1, 2], checked).tolist() == coded([0, 1], checked).tolist()


@given(
    st.lists(
        st.tuples(st.floats(0.01, 0.99), st.floats(0, 1).map(lambda y: round(y, 3))),
        max_size=6,
        unique_by=lambda p: round(p[0], 2),
    )
)
def test_own_points_are_met(inner: list[tuple[float, float]]) -> None:
    x, y = sorted(a for a, _ in inner), sorted(b for _, b in inner)
    points = ((0.0, 0.0), *zip(x, y, strict=True), (1.0, 1.0))
    checked = check_tone([list(point) for point in points], "tone")
    assert checked == points
    # a table of 4096 entries over the root
    assert np.allclose(coded(np.array(points)[:, 0], checked), np.array(points)[:, 1], atol=0.02)


@pytest.mark.parametrize(
    "tone", ["gamma", 2.2, None, [[0, 0]], [[0, 0], [0, 1]], [[0, 0], [0.5, 2], [1, 3]], [[0.1, 0], [1, 1]], [["a", 1]]]
)
def test_what_is_no_curve_is_refused(tone: object) -> None:
    with pytest.raises(SceneError, match=r"sensor\.tone: expected one of linear, srgb, s-curve, or points .*, got"):
        check_tone(tone, "sensor.tone")
