"""`peakmark identify --calibration --map`: poses as a user gets them, their files, and what to do without one."""

import csv
import json
from functools import cache, partial
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from peaksim import Camera, load_trajectory
from peaksim.geometry.pose import Pose, pose_distance
from peaksim.image_file import read_image

from peakmark.cli.marker import result, sheet_tiles
from peakmark.found import find
from peakmark.markers.sheet import Page, pages, paper_size
from tests.peakmark.cli.films import write_film
from tests.peakmark.cli.running import Run, runner
from tests.photographs import Paper, photograph, pose_over, save_photograph

CAMERA = Camera(800, 600, 640.0, 641.0, 402.0, 297.0, (0.05, -0.1, 0.0005, -0.0003))
POSES = [pose_over(0.45, 30, 20, 10), pose_over(0.5, 20, 200, 100), pose_over(0.4, 40, 300, 0)]


@cache
def sheet() -> tuple[Page, Paper]:
    page = pages(sheet_tiles("array-5", 55.0, "dark", "energy", None, 1), paper_size("a4"))[0]
    return page, Paper.of(page)


def taken(number: int, seed: int = 2, sigma: float = 3.0) -> NDArray[np.uint8]:
    """Return a photograph of the sheet from one of the poses."""
    return photograph(sheet()[1], CAMERA, POSES[number], np.random.default_rng(seed), sigma)


@pytest.fixture(scope="module")
def photographs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a sheet, a calibration, photographs of the sheet, and one without it."""
    folder = tmp_path_factory.mktemp("hands")
    (folder / "sheet").mkdir()
    (folder / "sheet" / "result.json").write_text(json.dumps(result((sheet()[0],), ["sheet.pdf"])), encoding="utf-8")
    CAMERA.save(folder / "cam.yaml")
    for number in range(3):
        save_photograph(folder / f"photo{number}.jpg", taken(number, number))
    save_photograph(folder / "none.jpg", np.full((600, 800), 90, np.uint8))
    return folder


@pytest.fixture
def identify(photographs: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Run:
    return partial(runner(photographs, monkeypatch, capfd), "identify")


KNOWN = ("--calibration", "cam.yaml", "--map", "sheet/result.json")


def assert_near(found: Pose, true: Pose, mm: float = 2.0, deg: float = 0.3) -> None:
    distance_m, angle_deg = pose_distance(found, true)
    assert 1000 * distance_m < mm
    assert angle_deg < deg


def test_the_search_knows_the_calibrated_focal_length(photographs: Path, identify: Run, tmp_path: Path) -> None:
    for known in ((), KNOWN[:2]):
        identify("photo0.jpg", *known, "--out", tmp_path / "f.csv")
        with (tmp_path / "f.csv").open(newline="", encoding="utf-8") as file:
            rows = [(float(row["x"]), float(row["y"])) for row in csv.DictReader(file)]
        image = read_image(photographs / "photo0.jpg")
        told, untold = (find(image, focal_px=focal_px).rows() for focal_px in (CAMERA.focal_px, None))
        assert rows == [(row.x, row.y) for row in (told if known else untold)]
        assert [row.x for row in told] != [row.x for row in untold]


def test_photographs_become_poses_in_every_format(photographs: Path, identify: Run, tmp_path: Path) -> None:
    sources = [f"photo{number}.jpg" for number in range(3)]
    done = identify(*sources, *KNOWN, "--poses", tmp_path / "p.tum", "--out", tmp_path / "f.csv")
    assert (done.returncode, done.stderr) == (0, "")
    assert "3 images: 9 markers, 3 arrays (codes 5 ×3), 3 poses" in done.stdout
    written = load_trajectory(tmp_path / "p.tum")
    assert written.times_s.tolist() == [0, 1, 2]
    for found, true in zip(written.world_from_camera, POSES, strict=True):
        assert_near(found, true)
    with (tmp_path / "p.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [row["file"] for row in rows] == sources
    assert np.allclose([float(row["tx"]) for row in rows], written.world_from_camera[:, 0, 3])
    assert all(0 < float(row["sigma_x_m"]) < 0.003 and row["markers"] == "3" for row in rows)
    with (tmp_path / "f.csv").open(newline="", encoding="utf-8") as file:
        first = next(csv.DictReader(file))
    ray = CAMERA.unproject([[float(first["x"]), float(first["y"])]])[0]
    pinhole = CAMERA.matrix[:2] @ (ray / ray[2])
    assert [float(first["x_undistorted"]), float(first["y_undistorted"])] == pytest.approx(pinhole)


def test_one_photograph_says_where_the_camera_was(identify: Run) -> None:
    done = identify("photo0.jpg", *KNOWN)
    x, y, z = (float(word.strip("(),")) for word in done.stdout.split("camera at ")[1].split()[:3])
    assert np.linalg.norm(np.array([x, y, z]) - POSES[0][:3, 3]) < 0.002
    assert "3 markers fit to 0.0" in done.stdout
    assert "focal length" not in done.stdout


def test_without_a_calibration_the_guess_is_said(identify: Run) -> None:
    done = identify("photo0.jpg", "--map", "sheet")
    assert "note: no --calibration: taking the focal length in its EXIF, 26 mm on 35 mm film" in done.stdout
    assert "° for that focal length; 3 markers" in done.stdout
    assert "camera at (" in done.stdout


def test_a_print_of_97_percent_is_nearer(identify: Run) -> None:
    def distance_of(*more: str) -> float:
        shown = identify("photo0.jpg", *KNOWN, *more).stdout
        return float(np.linalg.norm([float(w.strip("(),")) for w in shown.split("camera at ")[1].split()[:3]]))

    assert distance_of("--scale-bar-mm", "97") == pytest.approx(0.97 * distance_of(), abs=2e-4)


def test_a_film_has_its_own_times(photographs: Path, identify: Run, tmp_path: Path) -> None:
    frame = taken(0, sigma=1.0)
    write_film(tmp_path / "film.mp4", [frame, np.full_like(frame, 90), frame], "libx264")
    done = identify(tmp_path / "film.mp4", *KNOWN, "--poses", tmp_path / "p.tum")
    assert done.returncode == 0
    assert "3 images: 6 markers, 2 arrays (codes 5 ×2), 2 poses; nothing in 1" in done.stdout
    written = load_trajectory(tmp_path / "p.tum")
    assert written.times_s.tolist() == pytest.approx([0.0, 0.2])
    assert_near(written.world_from_camera[1], POSES[0], 4.0, 0.6)


def test_a_recording_is_a_source(photographs: Path, identify: Run, tmp_path: Path) -> None:
    pytest.importorskip("mcap")
    sources = [f"photo{number}.jpg" for number in range(2)]
    assert identify(*sources, *KNOWN, "--record", tmp_path / "a.mcap").returncode == 0
    done = identify(tmp_path / "a.mcap", *KNOWN, "--poses", tmp_path / "p.tum", "--overlay", tmp_path / "drawn")
    assert (done.returncode, done.stderr) == (0, "")
    assert "2 images: 6 markers, 2 arrays (codes 5 ×2), 2 poses" in done.stdout
    written = load_trajectory(tmp_path / "p.tum")
    assert written.times_s.tolist() == [0.0, 1.0]
    for found, true in zip(written.world_from_camera, POSES, strict=False):
        assert_near(found, true)
    assert [path.name for path in (tmp_path / "drawn").iterdir()] == ["a.overlay.mp4"]


def test_an_image_without_markers_says_why_there_is_no_pose(identify: Run) -> None:
    done = identify("none.jpg", *KNOWN)
    assert done.returncode == 0
    assert "too little contrast" in done.stdout
    assert "no pose: no marker was found" in done.stdout


@pytest.mark.parametrize("orientation", [3, 6, 8])
def test_a_phone_held_otherwise_gives_the_same_pose(identify: Run, tmp_path: Path, orientation: int) -> None:
    image = taken(0)
    save_photograph(tmp_path / "a.jpg", image, orientation)  # the sensor's pixels stay as they are
    done = identify(tmp_path / "a.jpg", *KNOWN, "--poses", tmp_path / "p.tum")
    assert done.returncode == 0, done.stderr
    assert_near(load_trajectory(tmp_path / "p.tum").world_from_camera[0], POSES[0])


def test_a_smaller_copy_needs_to_be_asked_for(identify: Run, tmp_path: Path) -> None:
    image = taken(0)
    half = image.reshape(300, 2, 400, 2).mean(axis=(1, 3)).astype(np.uint8)
    save_photograph(tmp_path / "half.jpg", half)
    done = identify(tmp_path / "half.jpg", *KNOWN)
    assert done.returncode == 2
    assert done.stderr == (
        f"error: {tmp_path}/half.jpg: expected 800×600 px, the size of cam.yaml, got 400×300; "
        "--scale-calibration if it is a smaller or larger copy\n"
    )
    done = identify(tmp_path / "half.jpg", *KNOWN, "--scale-calibration", "--poses", tmp_path / "p.tum")
    assert done.returncode == 0, done.stderr
    assert_near(load_trajectory(tmp_path / "p.tum").world_from_camera[0], POSES[0], 4.0, 0.6)


def test_of_several_images_the_one_of_another_size_is_left_out(identify: Run, tmp_path: Path) -> None:
    save_photograph(tmp_path / "tall.jpg", np.full((800, 600), 90, np.uint8))
    done = identify("photo0.jpg", tmp_path / "tall.jpg", *KNOWN)
    assert done.returncode == 1
    assert "got 600×800; it is rotated by 90°: calibrate with images that are held alike" in done.stderr
    assert "1 images: 3 markers, 1 arrays (codes 5 ×1), 1 poses; 1 left out" in done.stdout


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--calibration", "none.yaml"], "none.yaml: cannot be read: No such file or directory"),
        (["--calibration", "sheet/result.json"], "sheet/result.json: expected a calibration"),
        (["--map", "cam.yaml"], "cam.yaml: is not TOML"),
        (["--map", "none.toml"], "none.toml: cannot be read"),
        (["--poses", "p.tum"], "--poses: expected together with --map"),
        (["--poses", "p.xyz", "--map", "sheet"], "--poses p.xyz: expected a name ending in .tum, .txt, .csv, .jsonl"),
        (["--scale-bar-mm", "97"], "--scale-bar-mm: expected together with --map"),
        (["--scale-calibration"], "--scale-calibration: expected together with --calibration"),
    ],
)
def test_bad_input_is_one_line_and_status_2(identify: Run, arguments: list[str], words: str) -> None:
    done = identify("photo0.jpg", *arguments)
    assert done.returncode == 2
    assert words in done.stderr
    assert len(done.stderr.splitlines()) == 1
