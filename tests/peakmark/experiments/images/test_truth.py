"""Folders of images: the three kinds, and what is wrong with others in one line."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from peakmark.errors import InputError
from peakmark.experiments.images.truth import read_set
from tests.peakmark.experiments.images.image_set import CODE, MARKER_XY, write_set


def test_truth_is_read_as_it_was_written(tmp_path: Path) -> None:
    write_set(tmp_path)
    known = read_set(tmp_path)
    assert [image.file for image in known.images] == ["array.png", "lone.png", "plain.png"]
    assert [image.sensor for image in known.images] == ["phone"] * 3
    assert [m.code for m in known.images[0].markers] == [CODE] * 3
    assert known.images[1].markers[0].xy == MARKER_XY
    assert known.images[2].markers == ()
    assert known.read(0).shape == (360, 480)
    assert known.read(0).dtype == np.uint8


def test_photographs_alone_hold_no_markers(tmp_path: Path) -> None:
    write_set(tmp_path)
    (tmp_path / "truth.json").unlink()
    known = read_set(tmp_path)
    assert [(image.condition, image.markers) for image in known.images] == [("bare", ())] * 3


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"polarity": "grey"}, r"truth\.json: images\[0\]\.markers\[0\]\.polarity: .*dark.* got 'grey'"),
        ({"side_px": -1}, r"truth\.json: images\[0\]\.markers\[0\]\.side_px: "),
        ({"xy": [1.0]}, r"truth\.json: images\[0\]\.markers\[0\]\.xy"),
    ],
)
def test_bad_truth_is_one_line_that_names_the_field(tmp_path: Path, change: dict[str, Any], message: str) -> None:
    truth = write_set(tmp_path)
    truth[0]["markers"][0].update(change)
    (tmp_path / "truth.json").write_text(json.dumps(truth))
    with pytest.raises(InputError, match=message) as caught:
        read_set(tmp_path)
    assert "\n" not in str(caught.value)


def test_other_folders_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="expected a folder of images, found nothing"):
        read_set(tmp_path / "none")
    with pytest.raises(InputError, match=r"expected truth\.json, a corpus or photographs"):
        read_set(tmp_path)
    for content, message in (("[", "expected JSON"), ("[]", "at least one image"), ('[{"file": "../x.png"}]', "below")):
        (tmp_path / "truth.json").write_text(content)
        with pytest.raises(InputError, match=message):
            read_set(tmp_path)
