"""Figures in the README and on the site are those of the data files that the named commands wrote."""

import importlib.util
import json
import re
from collections.abc import Callable
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from peaksim import load_scene

from peakmark.experiments.comparison.figures import ComparisonFigures
from peakmark.experiments.comparison.results import verdict_rows
from peakmark.experiments.detectability.envelope import Reach, load_rates, reach, sentence
from peakmark.experiments.poses.figures import PoseFigures, figure_row
from peakmark.plain import from_plain
from peakmark.report.page import markdown_table
from tests.places import ROOT

CAMERAS = (("640×480", 600.0), ("1920×1080", 1400.0), ("2048×1536", 1774.0), ("4000×3000, a phone", 2890.0))
"""Of the table in "Choose a size": its first two columns."""

SIDE_M = 0.08


def keep_figures() -> ModuleType:
    """Import tools/keep_figures.py, which is no package."""
    spec = importlib.util.spec_from_file_location("keep_figures", ROOT / "tools" / "keep_figures.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def text(page: str) -> str:
    return (ROOT / page).read_text(encoding="utf-8")


def data(name: str) -> Any:
    return json.loads(text(f"docs/figures/data/{name}.json"))


def reached(focal_px: float) -> dict[float, Any]:
    """Return tilt → where a marker of 8 cm is found, from the shipped rates."""
    return {one.tilt_deg: one for one in reach(load_rates(), focal_px, SIDE_M)}


def before_misses_m(one: Reach) -> float | None:
    """Return how far a marker is found without a miss in between."""
    return one.gaps_m[0][0] if one.gaps_m else one.farthest_m


@pytest.mark.parametrize(("camera", "focal_px"), CAMERAS)
def test_how_far_a_marker_is_seen(camera: str, focal_px: float) -> None:
    at = reached(focal_px)
    near, far, steep = at[0.0].nearest_m, at[0.0].farthest_m, before_misses_m(at[60.0])
    row = f"| {camera} | {focal_px:g} | {near:.2f} to {far:.2f} m | to {steep:.2f} m |"
    assert row in text("docs/how-to/choose-a-size.md")


def test_the_first_page_says_the_same() -> None:
    small, phone = reached(600.0)[0.0].farthest_m, reached(2890.0)[0.0].farthest_m
    page = text("docs/index.md")
    assert f"to {small:.1f} m with 640×480 and f = 600 px, to {phone:.1f} m with a 12-megapixel phone" in page


def test_the_sides_that_a_marker_needs() -> None:
    rates, at = load_rates(), reached(1000.0)
    facing, steep = (1000.0 * SIDE_M / (before_misses_m(at[tilt]) or np.nan) for tilt in (0.0, 60.0))
    page = text("docs/how-to/choose-a-size.md")
    often = rates.side_px[rates.detected[list(rates.tilt_deg).index(60.0)] >= 0.98].min()
    needed = f"and {steep:.0f} px at 60° ({often:.0f} px in 98 of 100 views or more)"
    assert f"A marker needs {facing:.0f} px facing the camera, {needed}" in page
    assert f"95 % interval\nfrom {100 * rates.detected_low.max():.1f} %" in page.replace("interval ", "interval\n")


def test_the_tables_of_the_envelope() -> None:
    page = text("docs/figures/detectability.md")
    for tilt, one in reached(load_scene("floor").camera.fx).items():
        gaps = ", ".join(f"{a:.2f}–{b:.2f} m" for a, b in one.gaps_m)
        cells = [f"{tilt:g}°", f"{one.nearest_m:.2f} m", f"{one.farthest_m:.2f} m", gaps]
        rows = [[cell.strip() for cell in line.split("│")[1:-1]] for line in page.splitlines() if "│" in line]
        assert cells in rows


def test_what_is_said_of_sifts_marker_and_the_disc_at_60_degrees() -> None:
    page = " ".join(text("docs/figures/detectability.md").split())
    focal_px = load_scene("floor").camera.fx
    for marker, detector in (("surf-dark", "surf"), ("sift-dark", "sift"), ("sift-range-dark", "surf")):
        (one,) = (r for r in reach(load_rates(marker, detector), focal_px, SIDE_M) if r.tilt_deg == 60)
        assert sentence(SIDE_M, one) in page


@pytest.mark.parametrize(
    ("name", "shown"), [("detectability", 3), ("detectability_paper", 2)], ids=["random phases", "one image a point"]
)
def test_the_tables_of_detectability(name: str, shown: int) -> None:
    page = text("docs/figures/detectability.md")
    for rows in list(data(name)["tables"].values())[:shown]:
        measured = [row for row in rows if "not measured" not in row.get("what we find", "")]
        assert len(measured) > 2
        assert markdown_table(list(rows[0]), [list(row.values()) for row in measured]) in page


def test_the_lab_floor() -> None:
    floor, paper = data("floor"), data("floor_preset_paper")
    rows = dict(re.findall(r"^│ (.+?) +│ +(.+?) │$", text("docs/figures/floor.md"), flags=re.MULTILINE))
    assert rows["features"] == f"{floor['features']:,}"
    assert (rows["markers in view"], rows["markers found"]) == ("14", "14")
    assert (floor["markers_in_view"], floor["markers_found"], floor["false_detections"]) == (14, 14, 0)
    assert rows["responses above all clutter"] == f"{floor['responses_above_clutter']} for 14 markers"
    assert float(rows["response drop, last marker over strongest clutter"]) == pytest.approx(
        floor["response_drop"], abs=5e-4
    )
    for name in ("bias", "rms", "p95"):
        assert float(rows[f"localisation {name} (px)"]) == pytest.approx(floor["localisation_px"][name], rel=1e-3)
    page = text("docs/figures/floor.md")
    assert f"| features | {floor['features']:,} | {paper['features']:,} |".replace(",", " ") in page
    drops = f"{floor['response_drop']:.2f} | {paper['response_drop']:.2f} |"
    assert f"| response, last marker over strongest clutter | {drops}" in page
    assert f"14 of 14 markers are the strongest features, factor {floor['response_drop']:.0f} to the clutter" in text(
        "README.md"
    )


def test_the_lab_floor_with_sifts_markers() -> None:
    stretched, plain = data("floor_sift"), data("floor_sift_stretch_1")
    page = text("docs/figures/floor.md")

    def row(name: str, what: str) -> str:
        cells = (what.format(**found) for found in (stretched, plain))
        return f"| {name} | {' | '.join(cells)} |"

    thousands = [f"{found['features']:,}".replace(",", " ") for found in (stretched, plain)]
    assert f"| features | {thousands[0]} | {thousands[1]} |" in page
    assert row("markers found of 14, false", "{markers_found}, {false_detections}") in page
    many = "responses above all clutter (a round pattern has many orientations)"
    assert row(many, "{responses_above_clutter} for {markers_above_clutter} markers") in page
    assert row("response, last marker over strongest clutter", "{response_drop:.2f}") in page
    assert row("centre as SIFT gives it, rms", "{localisation_px[rms]:.3f} px") in page


def test_the_view_of_the_room() -> None:
    surf, sift, paper = data("cave"), data("cave_sift"), data("cave_rule_paper")
    page = " ".join(text("docs/figures/cave.md").split())
    assert f"with a factor of {surf['response_drop']:.1f} to the next" in page
    for found in (surf, sift, paper):
        assert (found["markers_found"], found["markers_in_view"], found["false_detections"]) == (6, 6, 0)
        assert (found["arrays_decoded"], found["arrays_in_view"], found["wrong_codes"]) == (2, 2, 0)
    pose = f"the camera {sift['pose_mm']:.2f} mm and {sift['pose_deg']:.3f}° off"
    assert f"6 of 6 in this view, both arrays read, {pose}" in page


def test_dense_walls() -> None:
    rows = data("dense_wall")["rows"]
    page = text("docs/figures/cave.md")
    for wall, name in (("dark", "dark markers"), ("light", "light markers"), ("mixed", "both")):
        both, one = [], []
        for posters in (True, False):
            (found,) = (row for row in rows if (row["wall"], row["posters"]) == (wall, posters))
            both.append(f"{found['features_per_megapixel']:,.0f}".replace(",", " "))
            seen = f"{found['in_both_views']:,}".replace(",", " ")
            one.append(f"{100 * found['repeatability']:.0f} % of {seen}")
        assert f"| {name} | {' | '.join(both)} | {' | '.join(one)} |" in page


def test_the_centres_of_round_markers() -> None:
    page, rows = text("docs/figures/centers.md"), data("centers")["rows"]
    told = {(row["kind"], row["noise"]): row for row in rows if row["way"] == "refine, focal length told"}
    kinds = ("sift-dark", "sift-light", "sift-range-dark", "sift-range-light")
    clean = [told[kind, 0.0] for kind in kinds]
    nearer = [f"{row['nearer_rms_px']:.4f}; {row['largest_cell_nearer_rms_px']:.4f} px" for row in clean]
    assert f"| the same, of the nearer of two places | {' | '.join(nearer)} |" in page
    assert max(row["largest_cell_nearer_rms_px"] for row in clean) < 0.02
    for noise in (0.0, 1.0, 2.0, 4.0, 8.0):
        cells = " | ".join(f"{told[kind, noise]['mean_square']:.2f}" for kind in kinds)
        assert f"| mean normalised square at σ {noise:g} | {cells} |" in page
    low, high = told["sift-dark", 0.0]["band"]
    assert f"{low:.2f}…{high:.2f} with 95 %" in page
    assert f"`{data('centers')['command']}`" in page


def test_surf_beside_opencv() -> None:
    ratios = json.loads(text("benchmarks/baseline.json"))
    page, speeds = text("docs/how-to/find-surf-key-points.md"), text("benchmarks/README.md")
    listed = [float(value) for value in re.findall(r"\(×([\d.]+)\)", speeds)]
    for name, image in (("floor 2048×3072", "lab floor"), ("photograph 1024×768",) * 2, ("photograph 640×480",) * 2):
        jobs = ("detect", "detect + describe", "strongest 200")
        factors = [ratios[f"{name} | {job} | opencv SURF"] for job in jobs]
        (row,) = (line for line in page.splitlines() if line.startswith(f"| {image}"))
        shown = [float(value) for value in re.findall(r"×([\d.]+) \|", row)]
        assert shown == [pytest.approx(f, abs=0.06 if f < 10 else 0.51) for f in factors]
        for job in jobs:
            for rival in ("opencv SURF", "opencv SIFT", "mahotas SURF"):
                ratio = ratios[f"{name} | {job} | {rival}"]
                assert min(abs(shown - ratio) for shown in listed) <= 0.055
    detect = [value for key, value in ratios.items() if "opencv SURF" in key and "strongest" not in key]
    assert f"{np.floor(min(detect)):.0f} to {np.floor(max(detect)):.0f} times faster" in text("README.md")


def test_the_first_page_says_who_wins_in_shadow() -> None:
    topics = json.loads(text("docs/figures/comparison/data.json"))["topics"]
    (shadow,) = (topic for topic in topics if topic["name"] == "shadow")
    found = {reader["reader"]: reader for reader in shadow["readers"]}
    ours, library, opencv = (found[name] for name in ("identify", "AprilTag-C", "OpenCV AprilTag"))
    words = f"{100 * ours['value']:.0f} % found, AprilTag {100 * library['value']:.0f} % by its own library, "
    assert f"{words}{100 * opencv['value']:.0f} % by OpenCV" in text("docs/index.md")
    assert opencv["high"] > ours["low"]  # level: the intervals overlap
    assert ours["low"] > library["high"]  # beaten: they do not


def test_the_first_page_says_who_wins_what() -> None:
    figures = from_plain(ComparisonFigures, json.loads(text("docs/figures/comparison/data.json")))
    names = [topic.name for topic in figures.topics]
    sides = dict(zip(names, (row[1] for row in verdict_rows(figures)), strict=True))
    assert {sides[name] for name in ("covered", "centre", "position 99")} == {"peakmark"}
    assert sides["processor"] == "others"
    assert {sides[name] for name in ("small", "shadow", "noise", "blur", "tilt", "pose", "position")} == {"level"}
    words = "ours win where prints are covered, in the centre and in the worst poses, tags in speed; "
    assert f"{words}small prints, noise, blur, tilt and the usual pose are level" in text("docs/index.md")


def test_poses_and_calibrations() -> None:
    page = text("docs/figures/poses.md")
    for each in data("poses")["poses"]:
        source, *counts, wrong, position, rotation, nees, inside = figure_row(from_plain(PoseFigures, each))
        table = page.split(f"From {source}:\n\n")[1].split("\n\n")[0]
        assert "| " + " | ".join((*counts, position, rotation, nees, inside)) + " |" in table
        assert (wrong, "none of\nwhich is wrong" in page) == ("0", True)
    page = text("docs/how-to/calibrate-a-camera.md")
    ours = [each for each in data("calibration")["cameras"] if each["board"] == "peakmark" and each["lens"] == "brown5"]
    field, focal = (np.array([each[name] for each in ours]) for name in ("field_px", "focal_percent"))
    nees = sum(each["nees"] for each in ours) / sum(each["parameters"] for each in ours)
    assert f"| `calibrate`, brown5 | {len(ours)} | {np.median(focal):.4f} ({focal.max():.4f}) % |" in page
    assert f"| {np.median(field):.3f} ({field.max():.3f}) px |" in page
    assert f"| {nees:.1f} |" in page


def test_every_page_of_figures_names_its_command_and_every_data_file_its_own() -> None:
    index = text("docs/figures/index.md")
    for page in (ROOT / "docs" / "figures").glob("*.md"):
        if page.name != "index.md":
            (row,) = (line for line in index.splitlines() if f"({page.name})" in line)
            assert "`" in row
    files = sorted((ROOT / "docs" / "figures" / "data").glob("*.json"))
    commands = {file.stem: json.loads(file.read_text(encoding="utf-8"))["command"] for file in files}
    assert commands == keep_figures().COMMANDS


def test_what_is_kept_of_a_result_does_not_depend_on_the_machine() -> None:
    result = {"features": 3, "time_s": {"load": 1.0}, "peak_memory_mb": 5.0, "gl_renderer": "llvmpipe"}
    assert keep_figures().kept(result, "peakmark cave") == {"command": "peakmark cave", "features": 3}


KINDS = (("surf", "energy"), ("sift", "energy"), ("sift", "range"), ("surf-disc", "range"))
"""Columns of the tables of kinds: detector and limit."""

OF_KIND: dict[str, Callable[[dict[str, Any]], str]] = {
    "found": lambda row: f"{row['found']} of {row['wanted']} ({percent(row['recall'])})",
    "false": lambda row: f"{row['false']} of {row['detections']} (precision {percent(row['precision'])})",
    "polarity wrong": lambda row: f"{row['wrong']} (up to {100 * row['wrong_polarity'][1]:.1f} %)",
    "arrays read": lambda row: f"{row['arrays_read']} of {row['arrays']} ({percent(row['arrays_recall'])})",
    "wrong codes": lambda row: f"{row['wrong_codes']}",
    "centre, rms an axis": lambda row: f"{row['rms_px']:.3f} px",
    "CPU over OpenCV's SIFT": lambda row: f"{row['cpu_over_opencv_sift']:.1f}",
}
"""Rows of those tables."""

GROUPS = {
    "tilt_deg": ("tilt", "°"),
    "side_px": ("side", " px"),
    "noise": ("noise, σ", ""),
    "blur_px": ("blur, σ", " px"),
}
"""Figure by which markers are grouped: its name, and its unit."""


def percent(interval: list[float]) -> str:
    return f"{100 * interval[0]:.1f}…{100 * interval[1]:.1f} %"


@pytest.mark.parametrize("place", ["floors", "rooms"])
def test_the_kinds_of_markers(place: str) -> None:
    page = text("docs/figures/kinds.md").split(f"## {place.capitalize()}")[1].split("\n## ")[0]
    rows = [row for row in data("kinds")["kinds"] if row["place"] == place]
    assert [(row["detector"], row["limit"]) for row in rows] == list(KINDS)
    for name, cell in OF_KIND.items():
        assert f"| {name} | {' | '.join(map(cell, rows))} |" in page


@pytest.mark.parametrize("by", GROUPS)
def test_the_kinds_of_markers_by_tilt_side_noise_and_blur(by: str) -> None:
    page, (name, unit) = text("docs/figures/kinds.md"), GROUPS[by]
    rows = data("kinds")["kinds"]
    for number, group in enumerate(rows[0]["groups"][by]):
        cells = []
        for kind in KINDS:
            own = [row["groups"][by][number] for row in rows if (row["detector"], row["limit"]) == kind]
            cells.append(f"{sum(one['found'] for one in own)} of {sum(one['of'] for one in own)}")
        if any(not cell.endswith(" of 0") for cell in cells):
            assert f"| {name} {group['from']:g}…{group['to']:g}{unit} | {' | '.join(cells)} |" in page
