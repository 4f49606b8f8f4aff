import numpy as np
import pytest

from peakmark import marker
from peakmark.experiments.detectability.figures import (
    figure_1,
    figure_2,
    figure_3,
    figure_4,
    figure_5,
    figure_6,
    vis_distance,
)


def images(figure):
    return [np.asarray(ax.images[0].get_array()) for ax in figure.axes if ax.images]


def test_figure_1_shows_both_markers_in_both_polarities_under_both_limits():
    shown = images(figure_1())
    np.testing.assert_array_equal(shown[2], marker.surf_marker(180))
    np.testing.assert_array_equal(shown[5], 255 - shown[4])
    assert [len(np.unique(image)) for image in shown[6:]] == [2, 2]


def test_figure_2_crosses_zero_at_the_disc_radius():
    ax = figure_2().axes[0]
    x, y = ax.lines[0].get_data()
    radius = marker.dog_zero_crossing(1.0)
    assert (y[np.abs(x) < radius - 0.02] < 0).all()
    assert (y[np.abs(x) > radius + 0.02] > 0).all()


def test_figures_3_and_5_show_the_filters_and_the_optimum():
    for shown, filters in zip(images(figure_3()), marker.surf_filters(9), strict=True):
        np.testing.assert_array_equal(shown, filters)
    grey, binary = images(figure_5())
    assert grey.shape == binary.shape == (15, 15)
    assert set(np.unique(np.sign(binary))) <= {-1, 0, 1}


def test_figure_4_marks_the_inner_cells_of_the_descriptor():
    bars = figure_4().axes[2].patches
    green = [i for i, bar in enumerate(bars, 1) if bar.get_facecolor() != bars[0].get_facecolor()]
    assert green == [*range(21, 29), *range(37, 45)]


def test_figure_4_draws_sifts_signature_and_what_white_paper_changes():
    axes = figure_4().axes
    for ax in axes[3::2]:
        heights = np.array([bar.get_height() for bar in ax.patches])
        inner = np.isin(np.arange(128) // 8, (5, 6, 9, 10))
        assert np.linalg.norm(heights) == pytest.approx(1)
        assert (heights[inner] ** 2).sum() > 0.85  # the signature
    black, white = (line.get_ydata() for line in axes[4].lines)
    assert black.shape == white.shape == (8,)
    assert (vis_distance(False), vis_distance(True)) == pytest.approx((0.035, 0.24), abs=0.005)
    assert np.linalg.norm(white - black) == pytest.approx(0.24, abs=0.01)


def test_figure_6_crosses_lie_on_the_truth_except_under_strong_perspective():
    gaps = []
    for ax in figure_6().axes:
        truth, *found = [line.get_xydata()[0] for line in ax.lines]
        gaps.append(np.linalg.norm(found[0] - truth) if found else np.nan)
    assert gaps[1] > 2 * gaps[2]
    assert np.nanmax(np.delete(gaps, [1, 7])) < 3
