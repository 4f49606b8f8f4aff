"""`peakmark calibrate` and `peakmark map` on photographs of a printed board."""

import json
from pathlib import Path

import numpy as np
import pytest
from peaksim import Camera
from peaksim.geometry.pose import look_at

from peakmark.cli.marker import result
from peakmark.markers.board import BOARD_LAYOUT, board_page
from peakmark.markers.sheet import paper_size
from tests.peakmark.cli.running import Run, runner
from tests.photographs import Paper, photograph, save_photograph

CAMERA = Camera(960, 720, 800.0, 801.0, 482.0, 357.0, (-0.1, 0.03, 0.0005, -0.0003))
EYES = [(0.05, 0.12, 0.2), (-0.1, 0.05, 0.21), (0.12, -0.06, 0.19), (-0.02, -0.13, 0.2), (0.09, 0.09, 0.2)]


@pytest.fixture(scope="module")
def photographs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a board of A5, photographs of it, one without it and one of another size."""
    folder = tmp_path_factory.mktemp("board")
    page, _ = board_page(paper_size("a5"), 9.0)
    (folder / "board").mkdir()
    text = json.dumps(result((page,), ["board.pdf"], BOARD_LAYOUT))
    (folder / "board" / "result.json").write_text(text, encoding="utf-8")
    (folder / "photos").mkdir()
    rng, paper = np.random.default_rng(0), Paper.of(page)
    for number, eye in enumerate(EYES):
        pose = look_at(eye, [0.0, 0.0, 0.0], [0, 1, 0.1])
        save_photograph(folder / "photos" / f"p{number}.jpg", photograph(paper, CAMERA, pose, rng, sigma=1.5))
    save_photograph(folder / "photos" / "none.jpg", np.full((720, 960), 90, np.uint8))
    save_photograph(folder / "photos" / "small.jpg", np.full((90, 120), 90, np.uint8))
    CAMERA.save(folder / "true.yaml")
    return folder


@pytest.fixture
def run(photographs: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Run:
    return runner(photographs, monkeypatch, capfd)


def test_photographs_of_a_board_become_a_camera(photographs: Path, run: Run, tmp_path: Path) -> None:
    known = ("photos", "--sheet", "board/result.json", "--lens", "brown4")
    done = run("calibrate", *known, "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    assert "error: none: left out: shows 0 markers of the board's arrays, of at least 8 needed" in done.stderr
    assert "error: small: left out: is of 120×90 px, the first of 960×720" in done.stderr
    found = Camera.load(tmp_path / "out" / "camera.yaml")
    for name in ("camera_info.yaml", "camchain.yaml", "cameras.txt"):
        assert np.allclose(Camera.load(tmp_path / "out" / name).matrix, found.matrix)
    written = json.loads((tmp_path / "out" / "result.json").read_text(encoding="utf-8"))
    for name, true in (("fx", CAMERA.fx), ("fy", CAMERA.fy), ("cx", CAMERA.cx), ("cy", CAMERA.cy)):
        parameter = written["parameters"][name]
        assert abs(parameter["value"] - true) < 5 * parameter["sigma"] < 8
    assert len(written["photographs"]) == 5
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "5 photographs were used" in page
    assert "fx" in page


def test_arrays_of_a_board_become_a_map(photographs: Path, run: Run, tmp_path: Path) -> None:
    sources = [f"photos/p{number}.jpg" for number in range(5)]
    known = ("--calibration", "true.yaml", "--sheet", "board/result.json")
    done = run("map", *sources, *known, "--out", tmp_path / "map")
    assert (done.returncode, done.stderr) == (0, "")
    board = json.loads((photographs / "board" / "result.json").read_text(encoding="utf-8"))
    middle = {
        code: np.mean([m["center_mm"] for m in board["markers"][8 * code : 8 * code + 8]], axis=0)
        for code in range(len(board["markers"]) // 8)
    }
    rows = [line.split("│") for line in done.stdout.splitlines() if line.startswith("│")]
    found = {int(row[1]): np.array([float(cell) for cell in row[2:5]]) for row in rows}
    assert found.keys() == middle.keys()
    for a in found:
        for b in found:
            true_m = np.linalg.norm(middle[a] - middle[b]) / 1000
            assert np.linalg.norm(found[a] - found[b]) == pytest.approx(true_m, abs=5e-4)
    done = run("identify", "photos/p0.jpg", "--calibration", "true.yaml", "--map", tmp_path / "map" / "map.toml")
    assert "camera at (" in done.stdout


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (
            ["calibrate", "photos/p0.jpg", "--sheet", "board"],
            "expected 3 or more photographs that show the board, got 1",
        ),
        (["calibrate", "photos", "--sheet", "hall"], "hall: expected a sheet with arrays"),
        (["calibrate", "photos", "--sheet", "board", "--lens", "x"], "--lens: expected one of pinhole"),
        (["map", "photos", "--sheet", "board", "--calibration", "none.yaml"], "none.yaml: cannot be read"),
        (["map", "photos", "--sheet", "hall", "--calibration", "true.yaml"], "expected a sheet of arrays of one size"),
    ],
)
def test_bad_input_is_one_line_and_status_2(run: Run, tmp_path: Path, arguments: list[str], words: str) -> None:
    done = run(*arguments, "--out", tmp_path / "out")
    assert done.returncode == 2
    assert words in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert not (tmp_path / "out").exists()
