"""The comparison: every design is found where truth says under good conditions, sheets print what they should."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from peaksim.geometry.pose import invert, transform

from peakmark.errors import InputError
from peakmark.experiments.cave.fiducials import (
    CAMERA,
    DESIGNS,
    SIDE_M,
    SWEEPS,
    Design,
    DesignComparison,
    SheetCondition,
    answer_trial,
    compare_designs,
    conditions,
    draw_sheet,
    find_design,
    id_count,
    random_pose,
    rates_figure,
    table_rows,
    width_m,
)


@pytest.mark.parametrize("design", DESIGNS)
def test_every_design_is_found_where_it_is(design: Design) -> None:
    answers = [answer_trial(design, SheetCondition(tilt_deg=20), np.random.default_rng(seed)) for seed in range(3)]
    assert all(answer.is_right for answer in answers)
    assert max(answer.error_px or 0 for answer in answers) < 0.5
    if design != "SURF marker":  # one marker alone carries no id, and a blob on a wall may look like it
        assert not any(answer.wrong for answer in answers)


@pytest.mark.parametrize("design", DESIGNS)
def test_a_design_that_is_covered_is_not_found(design: Design) -> None:
    answer = answer_trial(design, SheetCondition(occluded=1.0), np.random.default_rng(0))
    assert (answer.is_right, answer.wrong, answer.error_px) == (False, 0, None)


@pytest.mark.parametrize("design", DESIGNS)
@pytest.mark.parametrize("code", [0, 1])
def test_sheets_print_the_design_at_its_width(design: Design, code: int) -> None:
    paper = cv2.resize(draw_sheet(design, code), None, fx=0.8, fy=0.8, interpolation=cv2.INTER_AREA)
    assert [name for name, _ in find_design(design, paper)] == [code]
    printed = np.flatnonzero((draw_sheet(design, code) < 250).any(axis=0))
    assert np.ptp(printed) + 1 == pytest.approx(72 * width_m(design) / SIDE_M, abs=1)
    assert id_count(design) >= 2


@pytest.mark.parametrize(("tilt", "side"), [(0, 40), (60, 25)])
def test_the_camera_sees_the_side_and_the_tilt(tilt: float, side: float) -> None:
    pose = random_pose(SheetCondition(side, tilt), np.random.default_rng(1))
    half = 0.01 * SIDE_M / 2  # small, so that perspective within it does not count
    corners = half * np.array([[-1, 1, 0], [1, 1, 0], [1, -1, 0], [-1, -1, 0.0]])
    xy = CAMERA.project(transform(invert(pose), corners)).astype(np.float32)
    assert 100 * np.sqrt(cv2.contourArea(xy)) == pytest.approx(side, rel=0.01)
    assert np.degrees(np.arccos(-pose[2, 2])) == pytest.approx(tilt, abs=1e-4)


def test_sweeps_vary_one_quantity_and_rows_make_table_and_figure() -> None:
    assert len(conditions()) == sum(map(len, SWEEPS.values()))
    for quantity, value, condition in conditions():
        assert condition == replace(SheetCondition(), **{quantity: value})
    counts = {"right": 3, "trials": 4, "wrong": 1, "error_px_rms": None, "error_px_p95": None, "seconds": 0.1}
    rows = [DesignComparison(q, v, d, **counts) for q, v, _ in conditions() for d in DESIGNS]
    assert table_rows(rows)[0] == ("side of a marker or tag (px): 8", *["3 (1)"] * 4)
    assert table_rows(rows, "seconds")[0][1:] == (0.1,) * 4
    assert len(rates_figure(rows).axes) == len(SWEEPS)


def test_bad_arguments() -> None:
    for trials, seed in ((0, 0), (1, -1)):
        with pytest.raises(InputError, match=r"--(trials|seed): expected"):
            compare_designs(trials, seed)
