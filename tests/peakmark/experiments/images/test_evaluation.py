"""Images through our detector and the peers, counted by hand on a small set."""

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from peakmark.cli.command import plain_app
from peakmark.cli.images import evaluate_images
from peakmark.experiments.images.evaluation import IDENTIFY, Item, rows_of, summarise
from peakmark.experiments.images.outcome import evaluate_image
from peakmark.experiments.images.peers import PEERS
from peakmark.experiments.images.results import faults_of
from peakmark.experiments.images.truth import TrueImage, TrueMarker, read_set
from tests.peakmark.experiments.images.image_set import CODE, MARKER_XY, write_set


def test_the_small_set_is_counted_right(tmp_path: Path) -> None:
    write_set(tmp_path)
    known = read_set(tmp_path)
    outcomes = [evaluate_image(image, known.read(k), PEERS) for k, image in enumerate(known.images)]
    found = summarise(known.images, outcomes)
    assert (found.images, found.images_with_markers) == (3, 2)
    rows = {row.group: row.found for row in found.rows}
    assert rows["20 px and more"][IDENTIFY].of == 4
    assert rows["condition near"][IDENTIFY].of == 3
    for shares in rows.values():
        assert all(share.value == 1 for share in shares.values())
    assert [rows["20 px and more"][peer].of for peer in PEERS] == [1, 1]
    assert (found.arrays_read.value, found.arrays_read.of) == (1, 1)
    assert (found.wrong_codes, found.wrong_polarities) == (0, 0)
    assert {name: share.of for name, share in found.false_detections.items()} == {"with markers": 2, "without": 1}
    assert all(share.value == 0 for share in found.false_detections.values())
    assert found.false_tags == dict.fromkeys(PEERS, 0)
    assert (found.error_px_rms[IDENTIFY] or 9) < 0.1
    assert max(found.error_px_rms[peer] or 9 for peer in PEERS) < 0.3  # half a pixel would be another convention
    assert list(faults_of(outcomes)) == []


def test_what_is_missed_wrong_or_made_up_is_held_against_us(tmp_path: Path) -> None:
    write_set(tmp_path)
    known = read_set(tmp_path)
    lone, gray = known.images[1], known.read(1)
    (marker,) = lone.markers
    absent = marker.model_copy(update={"xy": (60.0, 60.0)})
    light = marker.model_copy(update={"polarity": "light"})
    other = TrueImage(file="x", markers=(absent,))
    outcome = evaluate_image(other, gray, ())
    assert [m.is_found for m in outcome.markers] == [False]
    assert [xy[:2] for xy in outcome.false_xy] == [pytest.approx(MARKER_XY, abs=0.2)]
    assert {fault.what.split(":")[0] for fault in faults_of([outcome])} == {"missed", "nothing there"}
    assert evaluate_image(TrueImage(file="x", markers=(light,)), gray, ()).markers[0].is_wrong
    beside = marker.model_copy(update={"xy": (MARKER_XY[0] + 15, MARKER_XY[1])})
    assert evaluate_image(TrueImage(file="x", markers=(beside,)), gray, ()).false_xy == ()


def test_arrays_count_their_codes(tmp_path: Path) -> None:
    write_set(tmp_path)
    known = read_set(tmp_path)
    image, gray = known.images[0], known.read(0)
    wrong = tuple(m.model_copy(update={"code": CODE ^ 1}) for m in image.markers)
    outcome = evaluate_image(image.model_copy(update={"markers": wrong}), gray, ())
    assert summarise([image], [outcome]).wrong_codes == 1
    nowhere = evaluate_image(TrueImage(file="x"), gray, ())
    assert summarise([TrueImage(file="x")], [nowhere]).wrong_codes == 1


def test_groups_divide_what_counts() -> None:
    rng = np.random.default_rng(0)
    items = [
        Item(
            IDENTIFY, rng.uniform(8, 200), rng.uniform(0, 78), "dark", "energy", paper, "a", "b", bool(rng.integers(2))
        )
        for paper in ("flat", "bent", "covered", "cut")
        for _ in range(50)
    ]
    rows = {row.group: row.found[IDENTIFY] for row in rows_of(items)}
    all_, big = rows["15 px and more"], rows["20 px and more"]
    assert sum(share.of for name, share in rows.items() if name.startswith("side")) == all_.of
    assert sum(share.of for name, share in rows.items() if name.startswith("tilt")) == big.of
    assert sum(share.count for name, share in rows.items() if name.startswith("tilt")) == big.count
    assert rows["bent paper"].of == sum(i.paper == "bent" and i.side_px >= 15 for i in items)


def test_a_marker_s_paper_is_told() -> None:
    marker = {"polarity": "dark", "xy": (0, 0), "side_px": 20, "tilt_deg": 0}
    from_visible = {1.0: "flat", 0.9: "covered", 0.3: "cut"}
    for visible, paper in from_visible.items():
        image = TrueImage(file="x", markers=(TrueMarker(visible=visible, **marker),))
        assert evaluate_image(image, np.full((40, 40), 128, np.uint8), ()).markers[0].paper == paper


def test_the_command_writes_page_and_result(tmp_path: Path) -> None:
    folder, out = tmp_path / "set", tmp_path / "out"
    folder.mkdir()
    write_set(folder)
    arguments = [str(folder), "--peers", "--out", str(out), "--quiet"]
    app = plain_app()
    app.command()(evaluate_images)
    outcome = CliRunner().invoke(app, arguments)
    assert (outcome.exit_code, outcome.output) == (0, "")
    result = json.loads((out / "result.json").read_text())
    assert result["figures"]["arrays_read"]["value"] == 1
    assert len(result["images"]) == 3
    assert {path.name for path in out.iterdir()} == {"result.json", "report.html", "rates.png"}
    page = (out / "report.html").read_text()
    assert "condition near" in page
    assert "AprilTag-C" in page
