"""EXIF: what a phone notes is read; odd files say nothing."""

from pathlib import Path

import numpy as np
import pytest
from peaksim.camera.guess import guessed_camera
from peaksim.exif_file import focal_35mm_of, orientation_of

from tests.photographs import save_photograph

GRAY = np.zeros((30, 40), np.uint8)


@pytest.mark.parametrize("orientation", [1, 3, 6])
def test_what_a_phone_notes_is_read(tmp_path: Path, orientation: int) -> None:
    save_photograph(tmp_path / "a.jpg", GRAY, orientation, 28)
    assert orientation_of(tmp_path / "a.jpg") == orientation
    assert focal_35mm_of(tmp_path / "a.jpg") == 28


def test_odd_files_say_nothing(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("none", encoding="utf-8")
    for path in (tmp_path / "a.txt", tmp_path / "missing", tmp_path):
        assert orientation_of(path) == 1
        assert focal_35mm_of(path) is None


def test_a_full_frame_camera_sees_what_its_lens_says() -> None:
    camera = guessed_camera(3600, 2400, 36.0)
    assert np.allclose([camera.fx, camera.fy, camera.cx, camera.cy], [3600, 3600, 1799.5, 1199.5])
    assert np.degrees(2 * np.arctan(2000 / guessed_camera(4000, 3000).fx)) == pytest.approx(67.3, abs=0.1)
