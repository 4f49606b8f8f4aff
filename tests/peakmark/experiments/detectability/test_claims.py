import re

from peakmark.experiments.detectability.claims import claims_table
from peakmark.experiments.detectability.points import sides_away
from peakmark.score.statistics import rate
from tests.peakmark.experiments.detectability.rows import curve, row

SURF, SIFT = ("surf-dark", "surf-paper"), ("sift-dark", "sift")


def found(rows, start):
    """Return what the table finds for the claim that begins with `start`."""
    (line,) = [line for line in claims_table(rows).rows if line[0].startswith(start)]
    return line[1]


def test_sizes_are_given_for_three_shares():
    rows = curve("scale", *SURF, {8: 0, 10: 5, 12: 60, 14: 100, 200: 100, 210: 70, 220: 20, 260: 0})
    text = found(rows, "the SURF marker is detected")
    assert text == "10 to 220 px in at least one view, 12 to 210 px in half, 14 to 200 px in all"


def test_ditches_name_both_markers():
    rows = [*curve("scale", *SURF, {20: 100, 26: 30, 30: 100}), *curve("scale", *SIFT, {2: 100, 4: 95, 8: 100})]
    assert found(rows, "both markers have").split("; ") == [
        f"{marker}: {found_at}, no ditch in the response"
        for marker, found_at in (("surf-dark", "found in less than 90 % at 26"), ("sift-dark", "found throughout"))
    ]


def test_a_weak_response_between_strong_ones_is_a_ditch_even_if_it_is_found():
    responses = {20: 10.0, 26: 7.0, 27: 7.5, 30: 9.0, 40: 8.0, 60: 12.0}
    rows = [row("scale", *SURF, x, response=response) for x, response in responses.items()]
    assert found(rows, "both markers have").endswith("response below 80 % of both sides' at 26")


def test_the_rotation_is_given_as_the_largest_departure_from_the_mean():
    rows = [row("turn", *SURF, x, response=response) for x, response in ((0, 9.0), (45, 11.0), (90, 10.0))]
    assert found(rows, "the response stays high") == "surf-dark within ±10 % of its mean"


def test_the_tilt_limit_is_where_the_rms_error_passes_3_px():
    figures = ((0, 100, 1.0), (25, 80, 3.5), (40, 100, 9.0))
    rows = [row("tilt", *SURF, x, hits, rms=rms, series=sides_away(1)) for x, hits, rms in figures]
    rows += [row("tilt", *SURF, x, rms=1.0, series=sides_away(20)) for x in (0, 80)]
    text = found(rows, "SURF's marker leaves")
    assert text.split("; ") == [
        "1 side away: beyond 3 px RMS from 25°, found in less than 90 % at 25°",
        "2 sides away: not measured",
        "5 sides away: not measured",
        "20 sides away: never beyond 3 px RMS, found throughout",
    ]


def test_noise_is_read_next_to_20_percent():
    rows = [row("noise", *SURF, x, hits, response_ratio=0.5) for x, hits in ((0, 100), (50, 97), (100, 60))]
    assert found(rows, "noise matters") == "surf-dark at σ 50: 97 % detected, response 50 % of the clean one"


def test_a_marker_that_is_not_found_has_no_error_beyond_3_px():
    rows = [
        row("tilt", *SIFT, x, hits, rms=rms, series=sides_away(20)) for x, hits, rms in ((0, 100, 1), (40, 0, None))
    ]
    assert found(rows, "SIFT's marker leaves").endswith(
        "20 sides away: never beyond 3 px RMS, found in less than 90 % at 40°"
    )


def test_one_image_a_point_is_no_share():
    one = {"trials": 1, "detected": rate(1, 1)}
    rows = [row("scale", *SURF, x, **one) for x in (14, 200)] + [row("scale", *SURF, 8, trials=1, detected=rate(0, 1))]
    rows += [row("tilt", *SURF, 40, trials=1, detected=rate(0, 1), series=sides_away(1))]
    assert found(rows, "the SURF marker is detected") == "14 to 200 px"
    assert found(rows, "both markers have").startswith("surf-dark: found throughout")
    assert found(rows, "SURF's marker leaves").startswith("1 side away: never beyond 3 px RMS, not found at 40°")


def test_sifts_signature_holds_most_of_its_descriptor():
    (share,) = {int(text) for text in re.findall(r"(\d+) % of its squares by sift", found([], "the DoG's main lobes"))}
    assert share == 88


def test_gain_bias_and_uniqueness_come_from_the_rows():
    rows = [
        *curve("turn", *SURF, {0: 100}),
        *curve("turn", "surf-range-dark", "surf-paper", {0: 100}, response=18.5),
        row("bias", "sift-dark", "sift-opencv", 4, bias_xy=(0.25, -0.3)),
        row("bias", "sift-dark", "sift-opencv", 8, bias_xy=(0.24, 0.26)),
        row("background", *SURF, 1, 80, series="gravel"),
    ]
    assert found(rows, "the markers trigger") == "surf-range-dark answers 1.85 times as strongly as surf-dark"
    assert found(rows, "(not in the paper)") == "median over the sizes: sift-opencv (+0.245, -0.020) px"
    assert found(rows, "the markers are uniquely") == "surf-dark on gravel 80 %"


def test_every_claim_has_a_line_even_without_rows():
    table = claims_table([])
    assert len(table.rows) == 11
    assert all(len(line) == 3 for line in table.rows)
    told = [line[0] for line in table.rows if line[1] != "not measured"]
    assert [claim.split("°")[0][-2:] for claim in told[:2]] == ["25", "35"]  # those name the distances not measured
    assert "sums of absolute gradients" in told[2]  # which needs no images, as the next
    assert "signature" in told[3]


def test_vlfeats_sift_stands_beside_opencvs():
    rows = [row("turn", "sift-dark", d, x, response=r) for d in ("sift", "vlfeat") for x, r in ((0, 9.99), (45, 10.01))]
    text = "sift-dark within ±0.1 % of its mean; sift-dark by vlfeat within ±0.1 % of its mean"
    assert found(rows, "the response stays high") == text


def test_light_and_dark_differ_on_paper_where_the_paper_says_that_they_do_not():
    assert "differ by 0.035 before black" in found([], "the descriptors of dark and light")
    assert "by 0.24 on white paper" in found([], "the descriptors of dark and light")
