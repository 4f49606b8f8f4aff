from dataclasses import replace

import numpy as np

from peakmark.experiments.detectability.curves import (
    LABELS,
    curve_figures,
    curves_figure,
    draw_rate,
    draw_response,
    panels_of,
)
from peakmark.experiments.detectability.figures import new_figure
from peakmark.experiments.detectability.points import EXPERIMENTS, DetectabilityConfig, points
from peakmark.report.plots import save
from tests.peakmark.experiments.detectability.rows import curve, row

SURF = [("surf-dark", "surf-paper", "")]


def test_every_experiment_with_an_axis_of_its_own_has_a_label_and_measured_curves():
    assert set(LABELS) == set(EXPERIMENTS) - {"bias", "map"}
    for experiment in LABELS:
        measured = {
            (p.condition.marker, d, p.series)
            for p in points(DetectabilityConfig(only=(experiment,)))
            for d in p.detectors
        }
        assert {c for panel in panels_of(experiment) for c in panel} & measured


def test_a_figure_shows_response_rate_and_error_of_each_curve():
    rows = curve("noise", *SURF[0][:2], {0: 100, 50: 90, 100: 0})
    figure = curves_figure(rows, "noise", [SURF, [("sift-dark", "sift", "")]])
    response, rate, error = figure.axes
    assert response.get_legend().get_texts()[0].get_text() == "surf-dark, surf-paper"
    np.testing.assert_allclose(response.lines[0].get_xydata(), [[0, 1], [50, 1], [100, np.nan]])
    np.testing.assert_allclose(rate.lines[0].get_ydata(), [1, 0.9, 0])
    np.testing.assert_allclose(error.lines[0].get_xydata(), [[0, 0.1], [50, 0.1]])


def test_the_band_around_a_rate_is_its_interval():
    rows = curve("noise", "m", "d", {0: 100, 50: 90})
    _, (ax,) = new_figure()
    draw_rate(ax, rows, "black")
    band = ax.collections[0].get_paths()[0].vertices
    assert band[:, 1].min() == rows[1].found.detected.low
    assert band[:, 1].max() == 1


def test_one_image_a_point_has_no_band():
    rows = [replace(one, found=replace(one.found, trials=1)) for one in curve("noise", "m", "d", {0: 100, 50: 90})]
    _, axes = new_figure(2)
    draw_rate(axes[0], rows, "black")
    draw_response(axes[1], rows, "black", "m")
    assert [len(ax.collections) for ax in axes] == [0, 0]
    assert axes[1].get_title() == "response"
    assert [len(ax.lines[0].get_xdata()) for ax in axes] == [2, 2]


def test_only_what_was_measured_is_drawn():
    rows = [*curve("scale", *SURF[0][:2], {10: 1, 20: 100}), *curve("jpeg", *SURF[0][:2], {5: 100})]
    assert list(curve_figures(rows)) == ["figure-7", "jpeg"]


def test_an_axis_on_which_nothing_was_found_can_be_drawn(tmp_path):
    figure = curves_figure(curve("exposure", *SURF[0][:2], {0.05: 0}), "exposure", [SURF])
    save(figure, tmp_path / "figure.png")
    assert [len(ax.lines[0].get_xdata()) for ax in figure.axes] == [1, 1, 0]
    assert np.isnan(figure.axes[0].lines[0].get_ydata()).all()


def test_the_response_goes_on_dotted_beyond_3_px_and_a_vertical_says_from_where():
    rows = [row("tilt", "m", "d", 0), row("tilt", "m", "d", 40, hits=0, rms=4.0, near_response_ratio=0.7)]
    _, (ax,) = new_figure()
    draw_response(ax, rows, "black", "m")
    solid, dotted, limit = ax.lines
    np.testing.assert_array_equal(solid.get_ydata(), [1, np.nan])
    np.testing.assert_array_equal(dotted.get_ydata(), [1, 0.7])
    assert limit.get_xdata()[0] == 40
    assert dotted.get_linestyle() == limit.get_linestyle() == ":"
