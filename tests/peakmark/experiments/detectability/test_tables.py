import pytest
from hypothesis import given
from hypothesis import strategies as st

from peakmark.experiments.detectability.envelope import load_rates
from peakmark.experiments.detectability.points import MAP_NOISES, MAP_TILTS_DEG, map_series
from peakmark.experiments.detectability.tables import (
    ditches,
    envelope_lines,
    envelope_table,
    gains,
    gains_table,
    passes,
    peak_ratio,
    reach,
    runs_text,
    select,
    span,
)
from peakmark.score.statistics import rate
from tests.peakmark.experiments.detectability.rows import curve, row


def test_only_a_sure_rate_passes():
    assert passes(row("scale", "m", "d", 1, 100))
    assert not passes(row("scale", "m", "d", 1, 98))
    assert passes(row("scale", "m", "d", 1, trials=8, detected=rate(8, 8)))
    assert not passes(row("scale", "m", "d", 1, trials=8, detected=rate(7, 8)))


def test_ditches_lie_inside_the_span():
    scale = curve("scale", "m", "d", {8: 0, 10: 100, 12: 90, 14: 80, 16: 100, 20: 100, 26: 50, 30: 100, 40: 0})
    assert span(scale) == (10, 30)
    assert ditches(scale) == [(12, 14), (26, 26)]
    assert runs_text(ditches(scale)) == "12–14, 26"
    assert span(scale[:1]) is None
    assert ditches(scale[:1]) == []


@given(st.lists(st.booleans(), max_size=20))
def test_reach_ends_before_the_first_failure(good):
    axis = curve("noise", "m", "d", {x: 100 if fine else 0 for x, fine in enumerate(good)})
    first = good.index(False) if False in good else len(good)
    assert reach(axis) == (first - 1 if first else None)
    last = good[::-1].index(False) if False in good else len(good)
    assert reach(axis, rising=False) == (len(good) - last if last else None)


def test_select_takes_one_curve_in_order():
    rows = curve("turn", "m", "d", {20: 1, 10: 1})
    rows += [row("turn", "m", "e", 5), row("noise", "m", "d", 1), row("turn", "m", "d", 7, series="far")]
    assert [r.x for r in select(rows, "turn", "m", "d")] == [10, 20]


def test_the_envelope_reads_every_axis_from_its_mild_end():
    rows = [
        *curve("scale", "surf-dark", "surf", {10: 100, 20: 0, 30: 100}),
        *curve("tilt", "surf-dark", "surf", {0: 100, 40: 100, 60: 20}, series="20 sides away"),
        *curve("noise", "surf-dark", "surf", {0: 100, 50: 100}),
        *curve("jpeg", "surf-dark", "surf", {5: 10, 50: 100, 90: 100}),
        *curve("contrast", "surf-dark", "surf", {0.1: 0, 0.5: 100, 1: 100}, series="uniform"),
        *curve("exposure", "surf-dark", "surf", {0.1: 0, 0.5: 100, 1: 100, 4: 0}),
        *curve("scale", "surf-range-dark", "sift", {10: 100}),
        *curve("bias", "sift-dark", "vlfeat", {4: 100}),
    ]
    table = envelope_table(rows)
    assert len(table.rows) == 1, "SIFT is a guest on a SURF marker, and of VLFeat no limit was measured"
    found = dict(zip(table.head, table.rows[0], strict=True))
    assert list(found.values()) == ["surf-dark", "surf", "10–30", "20", 40, 50, 50, 0.5, "×0.5–×1"]
    assert not any("blur" in name or "motion" in name for name in found), "what was not measured has no column"


def test_vlfeats_sift_has_its_own_line_and_a_users_detector_one_for_each_marker():
    names = {"sift-dark": ("vlfeat", "sift-opencv", "surf", "cv2:ORB"), "surf-dark": ("vlfeat", "cv2:ORB")}
    rows = [row("scale", marker, name, 10) for marker, detectors in names.items() for name in detectors]
    listed = [tuple(line[:2]) for line in envelope_table(rows).rows]
    assert listed == [("sift-dark", "vlfeat"), ("sift-dark", "cv2:ORB"), ("surf-dark", "cv2:ORB")]


def test_gains_compare_equal_sizes_that_are_always_found():
    rows = [
        *curve("turn", "surf-dark", "surf-paper", {0: 100, 45: 100, 90: 99}),
        *curve("turn", "surf-range-dark", "surf-paper", {0: 100, 45: 100, 90: 100}, response=18.5),
        row("scale", "sift-range-dark", "surf-paper", 4, response=15.0),
        row("scale", "surf-range-dark", "surf-paper", 40, response=20.0),
        row("scale", "surf-range-dark", "surf-paper", 80, 0),
    ]
    assert gains(rows, "turn", "surf-dark", "surf-range-dark", "surf-paper") == pytest.approx([1.85, 1.85])
    assert peak_ratio(rows, "sift-range-dark", "surf-range-dark", "surf-paper") == pytest.approx(0.75)
    assert peak_ratio(rows, "sift-range-dark", "surf-dark", "surf-paper") is None
    texts = [line[1] for line in gains_table(rows).rows]
    assert texts == ["surf-range-dark over surf-dark, turn", "plain disc over surf-range-dark, each at its best size"]


def test_the_map_is_what_the_envelope_command_reads(tmp_path):
    rows = [
        row("map", "surf-dark", "surf", side, 100 - int(tilt), series=map_series(tilt, noise))
        for side in (10, 20)
        for tilt in MAP_TILTS_DEG
        for noise in MAP_NOISES
    ]
    path = tmp_path / "envelope.csv"
    path.write_text("\n".join(envelope_lines(rows)) + "\n")
    rates = load_rates("surf-dark", "surf", 10.0, path)
    assert tuple(rates.tilt_deg) == MAP_TILTS_DEG
    assert rates.detected[:, 0] == pytest.approx([1 - tilt / 100 for tilt in MAP_TILTS_DEG])
