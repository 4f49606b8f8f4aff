"""What a stranger does with an installed copy: print a sheet, photograph it, and ask where the camera was."""

import csv
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from peaksim import Camera
from peaksim.geometry.pose import pose_distance
from peaksim.geometry.trajectory_file import load_trajectory
from PIL import Image

from tests.photographs import Paper, photograph, pose_over, save_photograph
from tests.places import ROOT

PHONE = Camera(4000, 3000, 2890.0, 2893.0, 2010.0, 1490.0, (0.08, -0.15, 0.0005, -0.0003, 0.05))
MOST_MM, MOST_DEG = 2.0, 0.1
VIEWS = 5


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder into which pip installed a wheel of this checkout."""
    folder = tmp_path_factory.mktemp("installed")
    pip = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check"]
    subprocess.run([*pip, "wheel", "--no-deps", "--wheel-dir", folder / "wheel", ROOT], check=True, timeout=600)
    (wheel,) = (folder / "wheel").glob("*.whl")
    subprocess.run([*pip, "install", "--no-deps", "--target", folder / "site", wheel], check=True, timeout=600)
    return folder / "site"


def peakmark(installed: Path, folder: Path, *arguments: str) -> str:
    """Run the installed copy's own command in a folder."""
    environment = {**os.environ, "PYTHONPATH": str(installed), "COLUMNS": "120"}
    command = [sys.executable, str(installed / "bin" / "peakmark"), *arguments]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.slow
def test_two_commands_from_print_to_pose(installed: Path, tmp_path: Path) -> None:
    peakmark(installed, tmp_path, "marker", "array-5", "--format", "png", "--dpi", "254", "--out", "sheet")
    (sheet,) = (tmp_path / "sheet").glob("*.png")
    paper = Paper(np.asarray(Image.open(sheet).convert("L"), dtype=np.float32), np.array([0.210, 0.297]))
    PHONE.save(tmp_path / "cam.yaml")
    rng = np.random.default_rng(0)
    poses = [pose_over(1.0, rng.uniform(10, 50), *rng.uniform(0, 360, 2)) for _ in range(VIEWS)]
    for number, pose in enumerate(poses):
        save_photograph(tmp_path / f"photo{number}.jpg", photograph(paper, PHONE, pose, rng))
    known = ("--calibration", "cam.yaml", "--map", "sheet/result.json", "--poses", "poses.tum")
    shown = peakmark(installed, tmp_path, "identify", *(f"photo{n}.jpg" for n in range(VIEWS)), *known)
    assert shown.count("arrays 5\n") == VIEWS
    found = load_trajectory(tmp_path / "poses.tum").world_from_camera
    errors = np.array([pose_distance(a, b) for a, b in zip(found, poses, strict=True)])
    assert 1000 * np.median(errors[:, 0]) <= MOST_MM
    assert np.median(errors[:, 1]) <= MOST_DEG
    with (tmp_path / "poses.csv").open(newline="", encoding="utf-8") as file:
        assert all(row["markers"] == "3" for row in csv.DictReader(file))
