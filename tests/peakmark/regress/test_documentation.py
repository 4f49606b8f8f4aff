"""docs/how-to/use-your-own-detector.md: its examples run, and its limits are the defaults."""

import re
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from peakmark.markers.patterns import surf_marker
from peakmark.regress.detector import DetectorSettings
from peakmark.regress.detector_process import open_process
from peakmark.regress.run import MOST_FAILURES
from tests.peaksim.corpus.helpers import child_environment
from tests.places import ROOT

PAGE = (ROOT / "docs/how-to/use-your-own-detector.md").read_text(encoding="utf-8")
EXAMPLES = dict(re.findall(r"```python\n# (\w+\.py); .*?\n(.*?)```", PAGE, re.DOTALL))


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder with the examples, from which children can import."""
    for name, text in EXAMPLES.items():
        (tmp_path / name).write_text(text)
    monkeypatch.setenv("PYTHONPATH", f"{child_environment()['PYTHONPATH']}:{tmp_path}")
    return tmp_path


def test_there_are_two_examples() -> None:
    assert set(EXAMPLES) == {"my_detector.py", "my_program.py"}


@pytest.mark.usefixtures("folder")
def test_the_function_finds_markers() -> None:
    image = np.full((200, 200), 255, np.uint8)
    cv2.circle(image, (90, 70), 10, 0, -1)
    with open_process("my_detector:find", {"darkest": 50}, 10, 30) as detect:
        (found,) = detect(image).detections or ()
    assert found.xy.tolist() == [90, 70]
    assert found.polarity == "dark"


def test_the_program_answers(folder: Path) -> None:
    image = np.full((200, 200), 255, np.uint8)
    image[60:115, 50:105] = surf_marker(55)
    with open_process(f"exec:{sys.executable} {folder / 'my_program.py'}", {}, 10, 30) as detect:
        found = detect(image)
    expected = cv2.FastFeatureDetector_create().detect(image)
    assert sorted(map(tuple, found.features.xy.tolist())) == sorted(point.pt for point in expected)
    assert found.detections is None


def test_the_limits_are_the_defaults() -> None:
    defaults = DetectorSettings()
    assert f"`--time-limit` ({defaults.time_limit_s:g} s)" in PAGE
    assert f"`--start-limit` ({defaults.start_limit_s:g} s)" in PAGE
    assert MOST_FAILURES == 5
    assert "Five failures in a row" in PAGE
