"""`peakmark detect`: images, folders and films in; key points, overlays, a summary out; damaged files refused."""

import json
import os
import struct
import subprocess
import sys
import zlib
from pathlib import Path

import av
import numpy as np
import pytest
from PIL import Image

from peakmark import surf
from peakmark.cli.detect_files import detect_files, read_film, read_images
from peakmark.errors import ImageError, InputError
from peakmark.keypoints.keypoints import Keypoints
from tests.places import SOURCES
from tests.samples import assert_equal, speckled

GRAY = speckled(96, 128, 4)


def write_film(path: Path, frames: list[np.ndarray]) -> None:
    with av.open(str(path), "w") as container:
        stream = container.add_stream("mpeg4", rate=10)
        stream.width, stream.height, stream.pix_fmt = frames[0].shape[1], frames[0].shape[0], "yuv420p"
        for pixels in frames:
            container.mux(stream.encode(av.VideoFrame.from_ndarray(np.dstack([pixels] * 3), format="rgb24")))
        container.mux(stream.encode())


def write_bomb(path: Path, side: int) -> None:
    """Write the start of a PNG of side × side black pixels: a header that asks for all of them, and a few rows."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", side, side, 8, 0, 0, 0, 0)
    rows = zlib.compress(bytes(100 * (1 + side)))
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", rows) + chunk(b"IEND", b""))


def peakmark(*arguments: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "peakmark.cli", *map(str, arguments)]
    environment = {**os.environ, "PYTHONPATH": SOURCES}
    return subprocess.run(command, capture_output=True, text=True, check=False, env=environment, timeout=300)


@pytest.mark.parametrize("ending", [".npz", ".csv", ".json"])
@pytest.mark.parametrize("image", ["a.png", "a.tif", "a.bmp"])
def test_an_image_into_each_format(tmp_path: Path, image: str, ending: str) -> None:
    Image.fromarray(GRAY).save(tmp_path / image)
    records = detect_files(tmp_path / image, tmp_path / f"k{ending}")
    expected = surf.detect_and_describe(GRAY)
    assert [record.keypoints for record in records] == [len(expected)] != [0]
    assert_equal(Keypoints.load(tmp_path / f"k{ending}"), expected)


def test_a_jpeg_is_read_as_it_is_decoded(tmp_path: Path) -> None:
    Image.fromarray(GRAY).save(tmp_path / "a.jpg", quality=60)
    detect_files(tmp_path / "a.jpg", tmp_path / "k.npz")
    decoded = np.asarray(Image.open(tmp_path / "a.jpg"))
    assert_equal(Keypoints.load(tmp_path / "k.npz"), surf.detect_and_describe(decoded))


def test_a_folder_with_overlays_and_a_summary(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    for name, pixels in (("b", GRAY), ("a", GRAY[::-1])):
        Image.fromarray(pixels).save(tmp_path / "in" / f"{name}.png")
    (tmp_path / "in" / "notes.txt").write_text("no image", encoding="utf-8")
    detect_files(tmp_path / "in", tmp_path / "out", parameters={"strongest": 5}, overlay=True)
    result = json.loads((tmp_path / "out" / "result.json").read_text(encoding="utf-8"))
    assert [(p["name"], p["keypoints"]) for p in result["pictures"]] == [("a", 5), ("b", 5)]
    assert result["settings"]["strongest"] == 5
    overlay = np.asarray(Image.open(tmp_path / "out" / "a.overlay.png"))
    assert overlay.shape == (*GRAY.shape, 3)
    drawn = (overlay != GRAY[::-1, :, None]).any(axis=2)
    assert 20 < drawn.sum() < drawn.size / 2
    assert_equal(Keypoints.load(tmp_path / "out" / "a.npz"), surf.detect_and_describe(GRAY[::-1], strongest=5))


def test_a_film_frame_by_frame(tmp_path: Path) -> None:
    write_film(tmp_path / "f.mp4", [GRAY, GRAY[::-1].copy(), GRAY])
    records = detect_files(tmp_path / "f.mp4", tmp_path / "out")
    assert [record.name for record in records] == ["f_000000", "f_000001", "f_000002"]
    assert (records[0].width, records[0].height) == (128, 96)
    frames = list(read_film(tmp_path / "f.mp4"))
    assert_equal(Keypoints.load(tmp_path / "out" / "f_000001.npz"), surf.detect_and_describe(frames[1]))


def test_what_cannot_be_read_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="expected a folder of images with different names, got none"):
        list(read_images(tmp_path))
    (tmp_path / "f.mp4").write_bytes(b"\x00" * 999)
    with pytest.raises(ImageError, match=r"f\.mp4: expected a film"):
        list(read_film(tmp_path / "f.mp4"))
    for name in ("a.png", "a.bmp"):
        Image.fromarray(GRAY).save(tmp_path / name)
    with pytest.raises(InputError, match="got two called a"):
        list(read_images(tmp_path))
    with pytest.raises(InputError, match=r"expected a folder, as .* holds many images"):
        detect_files(tmp_path, tmp_path / "k.npz")
    with pytest.raises(InputError, match=r"expected one of \.npz, \.csv, \.json, got '\.xml'"):
        detect_files(tmp_path / "a.png", tmp_path / "out", ending=".xml")


def test_the_command_says_where_the_key_points_are(tmp_path: Path) -> None:
    Image.fromarray(GRAY).save(tmp_path / "a.png")
    Image.fromarray(np.uint8(GRAY > 128) * 255).save(tmp_path / "mask.png")
    done = peakmark("detect", tmp_path / "a.png", "--out", tmp_path / "k.csv", "--mask", tmp_path / "mask.png")
    assert done.returncode == 0, done.stderr
    expected = surf.detect_and_describe(GRAY, mask=GRAY > 128)
    assert f"a: {len(expected)} key points in 128×96 px" in done.stdout
    assert_equal(Keypoints.load(tmp_path / "k.csv"), expected)


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        ("bomb", "expected at most"),
        ("truncated", "damaged: image file is truncated"),
        ("text", "expected"),
        ("missing", "No such file"),
        ("threshold", "threshold: expected a finite number of at least 0, got -1.0"),
    ],
)
def test_damaged_files_end_in_one_line_and_exit_2(tmp_path: Path, damage: str, message: str) -> None:
    path = tmp_path / "a.png"
    Image.fromarray(GRAY).save(path)
    if damage == "bomb":
        write_bomb(path, 30_000)
    elif damage == "truncated":
        path.write_bytes(path.read_bytes()[:2000])
    elif damage == "text":
        path.write_text("no image", encoding="utf-8")
    elif damage == "missing":
        path.unlink()
    extra = ["--threshold", "-1"] if damage == "threshold" else []
    done = peakmark("detect", path, "--out", tmp_path / "k.npz", *extra)
    assert done.returncode == 2
    assert len(done.stderr.strip().splitlines()) == 1, done.stderr
    assert message in done.stderr
    assert not (tmp_path / "k.npz").exists()
