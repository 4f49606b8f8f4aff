"""Films: upright as OpenCV shows them; of what is cut or damaged the frames that are left, then the error."""

from pathlib import Path

import av
import cv2
import numpy as np
import pytest

from peakmark.cli.film_file import read_film
from peakmark.errors import ImageError
from tests.peakmark.cli.films import rotate_mp4, write_film
from tests.samples import speckled

GRAY = speckled(96, 128, 4)
FIRST = {"movflags": "faststart"}
NOISE = list(np.random.default_rng(0).integers(0, 255, (20, 96, 128), dtype=np.uint8))
FRAMES = [np.roll(GRAY, 7 * k, axis=1) for k in range(3)]


def frames_of_opencv(path: Path) -> list[np.ndarray]:
    capture = cv2.VideoCapture(str(path))
    frames = []
    while (frame := capture.read()[1]) is not None:
        frames.append(frame[:, :, ::-1])
    return frames


@pytest.mark.parametrize("clockwise_deg", [0, 90, 180, 270])
def test_frames_come_upright_as_opencv_shows_them(tmp_path: Path, clockwise_deg: int) -> None:
    write_film(tmp_path / "f.mp4", FRAMES)
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
    ("name", "codec", "has_index_first"),
    [
        ("f.avi", "mpeg4", True),
        ("f.mkv", "mpeg4", True),
        ("f.mp4", "mpeg4", False),
        ("f.mov", "mpeg4", False),
        ("f.webm", "libvpx", True),
    ],
)
@pytest.mark.parametrize("share", [0.4, 0.7, 0.95])
def test_a_cut_film_gives_its_whole_frames_then_says_so(
    tmp_path: Path, name: str, codec: str, has_index_first: bool, share: float
) -> None:
    write_film(tmp_path / name, NOISE, codec)
    frames = list(read_film(tmp_path / name))
    whole, left = (tmp_path / name).read_bytes(), []
    (tmp_path / name).write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(ImageError, match=rf"{name}: expected a film, cut: expected \d+ bytes, got \d+") as raised:
        left += read_film(tmp_path / name)
    assert np.array_equal(left, frames[: len(left)])
    assert 0 < len(left) < len(frames) if has_index_first else not left
    assert (f"frames end after {len(left) / 10:.3g} s" in str(raised.value)) == has_index_first
    assert "\n" not in str(raised.value)


def test_a_cut_film_with_its_index_in_front_gives_its_whole_frames(tmp_path: Path) -> None:
    write_film(tmp_path / "f.mp4", NOISE)
    with av.open(str(tmp_path / "f.mp4")) as source, av.open(str(tmp_path / "g.mp4"), "w", options=FIRST) as target:
        stream = target.add_stream_from_template(source.streams.video[0])
        for packet in source.demux(source.streams.video[0]):
            if packet.dts is not None:
                packet.stream = stream
                target.mux(packet)
    frames, left = list(read_film(tmp_path / "g.mp4")), []
    whole = (tmp_path / "g.mp4").read_bytes()
    (tmp_path / "g.mp4").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(ImageError, match=r"cut: .* it states 2 s, and its frames end after 0\.\d s$"):
        left += read_film(tmp_path / "g.mp4")
    assert 0 < len(left) < len(frames)
    assert np.array_equal(left, frames[: len(left)])


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
