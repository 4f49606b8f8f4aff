"""The one reader of text: a byte order mark is no content, and what is no text, or too much, is named in one line."""

from pathlib import Path

import numpy as np
import pytest
from peaksim import load_scene, load_trajectory
from peaksim.errors import InputError, SceneError
from peaksim.text_file import read_text
from peaksim.toml_file import parse_toml

from peakmark.experiments.detectability.envelope import load_rates
from peakmark.identification.classifier import SHIPPED, load_classifier
from peakmark.keypoints.keypoints import Keypoints
from peakmark.plain import to_plain
from tests.places import ROOT

BOM = b"\xef\xbb\xbf"
POSE = {"tum": b"1.5 1 2 3 0 0 0 1\n", "euroc": b"1500000000,1,2,3,1,0,0,0\n", "kitti": b"1 0 0 1 0 1 0 2 0 0 1 3\n"}


@pytest.mark.parametrize("format", POSE)
def test_trajectories_may_begin_with_a_byte_order_mark(tmp_path: Path, format: str) -> None:
    (tmp_path / "path").write_bytes(BOM + POSE[format].replace(b"\n", b"\r\n"))
    assert np.array_equal(load_trajectory(tmp_path / "path").world_from_camera[0, :3, 3], [1, 2, 3])


def test_scenes_may_begin_with_a_byte_order_mark(tmp_path: Path) -> None:
    plain = (ROOT / "scenes" / "cave.toml").read_bytes()
    (tmp_path / "cave.toml").write_bytes(BOM + plain)
    assert parse_toml(tmp_path / "cave.toml") == parse_toml(ROOT / "scenes" / "cave.toml")
    (tmp_path / "empty.toml").write_bytes(BOM)
    with pytest.raises(SceneError, match=r"empty\.toml: "):
        load_scene(tmp_path / "empty.toml")


def test_classifiers_rates_and_key_points_may_begin_with_a_byte_order_mark(tmp_path: Path) -> None:
    (tmp_path / "classifier.json").write_bytes(BOM + Path(SHIPPED).read_bytes())
    assert to_plain(load_classifier(tmp_path / "classifier.json")) == to_plain(load_classifier(SHIPPED))
    rates = b"marker,detector,noise,tilt_deg,side_px,detected,detected_low\nsurf-dark,surf,0,0,20,1,0.97\n"
    (tmp_path / "rates.csv").write_bytes(BOM + rates)
    assert load_rates(path=tmp_path / "rates.csv").side_px == [20]
    keypoints = Keypoints(*([[[1, 2]]] + [[3]] * 6))
    for ending in ("csv", "json"):
        keypoints.save(tmp_path / f"k.{ending}")
        (tmp_path / f"k.{ending}").write_bytes(BOM + (tmp_path / f"k.{ending}").read_bytes())
        assert np.array_equal(Keypoints.load(tmp_path / f"k.{ending}").xy, [[1, 2]])


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"\xff\xfea\0", "is not a text file in UTF-8: invalid start byte at byte 0"),
        (b"12345678901", "expected a file of at most 10 bytes"),
        (None, "cannot be read: No such file or directory"),
    ],
)
def test_what_is_no_text_is_named(tmp_path: Path, content: bytes | None, message: str) -> None:
    file = tmp_path / "file.txt"
    if content is not None:
        file.write_bytes(content)
    with pytest.raises(InputError) as caught:
        read_text(file, 10)
    assert str(caught.value) == f"{file}: {message}"
    assert read_text(Path("/dev/null"), 10) == ""
    with pytest.raises(InputError, match="at most 10 bytes"):  # which has no end
        read_text(Path("/dev/zero"), 10)
