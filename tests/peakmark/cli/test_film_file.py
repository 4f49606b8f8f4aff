"""Films: upright as OpenCV shows them, and refused where the file ends before the film does."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from peakmark.cli.film_file import read_film
from peakmark.errors import ImageError
from tests.peakmark.cli.films import rotate_mp4, write_film
from tests.samples import speckled

GRAY = speckled(96, 128, 4)
NOISE = list(np.random.default_rng(0).integers(0, 255, (20, 96, 128), dtype=np.uint8))
FRAMES = [np.roll(GRAY, 7 * k, axis=1) for k in range(20)]


def frames_of_opencv(path: Path) -> list[np.ndarray]:
    capture = cv2.VideoCapture(str(path))
    frames = []
    while (frame := capture.read()[1]) is not None:
        frames.append(frame[:, :, ::-1])
    return frames


@pytest.mark.parametrize("clockwise_deg", [0, 90, 180, 270])
def test_frames_come_upright_as_opencv_shows_them(tmp_path: Path, clockwise_deg: int) -> None:
    write_film(tmp_path / "f.mp4", FRAMES[:3])
    stored = list(read_film(tmp_path / "f.mp4"))
    rotate_mp4(tmp_path / "f.mp4", clockwise_deg)
    expected = frames_of_opencv(tmp_path / "f.mp4")
    upright = list(read_film(tmp_path / "f.mp4"))
    assert len(upright) == len(expected) == 3
    for frame, other, plain in zip(upright, expected, stored, strict=True):
        assert np.array_equal(frame, np.rot90(plain, -clockwise_deg // 90))
        assert frame.shape == other.shape
        assert np.abs(frame.astype(int) - other).mean() < 3  # another conversion from YUV
    assert np.array_equal(list(read_film(tmp_path / "f.mp4", is_upright=False)), stored)


@pytest.mark.parametrize(
    ("name", "codec"),
    [("f.avi", "mpeg4"), ("f.mkv", "mpeg4"), ("f.mp4", "mpeg4"), ("f.mov", "mpeg4"), ("f.webm", "libvpx")],
)
@pytest.mark.parametrize("share", [0.4, 0.7, 0.95])
def test_a_cut_film_is_refused(tmp_path: Path, name: str, codec: str, share: float) -> None:
    write_film(tmp_path / name, FRAMES, codec)
    assert len(list(read_film(tmp_path / name))) == len(FRAMES)
    whole = (tmp_path / name).read_bytes()
    (tmp_path / name).write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(ImageError, match=rf"{name}: expected a film, cut: expected \d+ bytes, got \d+"):
        list(read_film(tmp_path / name))


@pytest.mark.parametrize("name", ["f.avi", "f.mkv"])
def test_a_film_whose_end_was_never_filled_is_refused_after_its_frames(tmp_path: Path, name: str) -> None:
    write_film(tmp_path / name, NOISE)
    whole = (tmp_path / name).read_bytes()
    half = len(whole) // 2
    (tmp_path / name).write_bytes(whole[:half] + bytes(len(whole) - half))
    frames = []
    with pytest.raises(ImageError, match=r"damaged: it states 2 s, and its frames end after \d"):
        frames += read_film(tmp_path / name)
    assert len(frames) < len(NOISE)


@pytest.mark.parametrize("content", [b"", b"RIFF", b"RIFF\xff\xff\xff\xffAVI ", b"\x1aE\xdf\xa3", b"\0\0\0\0moov" * 9])
def test_what_is_no_film_is_named(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "f.mkv").write_bytes(content)
    with pytest.raises(ImageError, match=r"f\.mkv: expected a film") as caught:
        list(read_film(tmp_path / "f.mkv"))
    assert "\n" not in str(caught.value)
