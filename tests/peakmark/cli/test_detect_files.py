"""`peakmark detect`: images, folders and films in; key points, overlays, a summary out; damaged files refused."""

import json
import os
import struct
import subprocess
import sys
import zlib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from peakmark import surf
from peakmark.cli.detect_files import detect_files
from peakmark.cli.film_file import read_film
from peakmark.cli.sources import FailedFile, read_images
from peakmark.errors import ImageError, InputError
from peakmark.keypoints.keypoints import Keypoints
from tests.peakmark.cli.films import write_film
from tests.peakmark.cli.running import Run, runner
from tests.places import SOURCES
from tests.samples import assert_equal, speckled

GRAY = speckled(96, 128, 4)


def write_bomb(path: Path, side: int) -> None:
    """Write the start of a PNG of side × side black pixels: a header that asks for all of them, and a few rows."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", side, side, 8, 0, 0, 0, 0)
    rows = zlib.compress(bytes(100 * (1 + side)))
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", rows) + chunk(b"IEND", b""))


@pytest.fixture
def peakmark(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Run:
    return runner(tmp_path, monkeypatch, capfd)


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


def test_the_command_says_where_the_key_points_are(tmp_path: Path, peakmark: Run) -> None:
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
def test_damaged_files_end_in_one_line_and_exit_2(tmp_path: Path, peakmark: Run, damage: str, message: str) -> None:
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


def write_folder(folder: Path) -> None:
    """Write two sound images, a cut one, what macOS leaves beside files on other systems, and a folder and a pipe."""
    folder.mkdir()
    for name in ("a.png", "c.png", "cut.png"):
        Image.fromarray(GRAY).save(folder / name)
    (folder / "cut.png").write_bytes((folder / "a.png").read_bytes()[:2000])
    (folder / "._a.png").write_bytes(b"\0\5\x16\7\0\2\0\0Mac OS X        " + bytes(60))
    (folder / "folder.png").mkdir()
    os.mkfifo(folder / "pipe.png")


def test_bad_files_of_a_folder_are_named_and_left_out(tmp_path: Path, peakmark: Run) -> None:
    write_folder(tmp_path / "in")
    done = peakmark("detect", tmp_path / "in", "--out", tmp_path / "out", "--quiet")
    assert done.returncode == 1
    lines = done.stderr.splitlines()
    assert [line.split(": ")[1] for line in lines] == [
        str(tmp_path / "in" / name) for name in ("._a.png", "cut.png", "folder.png", "pipe.png")
    ]
    result = json.loads((tmp_path / "out" / "result.json").read_text(encoding="utf-8"))
    assert [one["name"] for one in result["pictures"]] == ["a", "c"]
    assert [one["name"] for one in result["failed"]] == ["._a.png", "cut.png", "folder.png", "pipe.png"]
    assert [f"error: {one['reason']}" for one in result["failed"]] == lines
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["a.npz", "c.npz", "result.json"]


def test_a_second_run_into_the_source_does_not_read_its_own_overlays(tmp_path: Path) -> None:
    for name in ("a", "b"):
        Image.fromarray(GRAY).save(tmp_path / f"{name}.png")
    Image.fromarray(GRAY).save(tmp_path / "mine.overlay.png")  # no key points beside it: an image like others
    for _ in range(2):
        records = detect_files(tmp_path, tmp_path, overlay=True)
        assert [record.name for record in records] == ["a", "b", "mine.overlay"]


@pytest.mark.parametrize("out", ["/proc/none", "/proc/none/k.npz", "a.png", "a.png/k.npz", "a.png/deeper"])
def test_where_nothing_can_be_written_is_one_line(tmp_path: Path, peakmark: Run, out: str) -> None:
    Image.fromarray(GRAY).save(tmp_path / "a.png")
    before = (tmp_path / "a.png").read_bytes()
    done = peakmark("detect", tmp_path / "a.png", "--out", tmp_path / out, "--quiet")
    assert done.returncode == 2
    assert done.stderr.startswith(f"error: --out {tmp_path / out}: expected a path that can be written: ")
    assert len(done.stderr.splitlines()) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["a.png"]
    assert (tmp_path / "a.png").read_bytes() == before


def test_a_film_that_ends_early_keeps_what_was_done_and_says_so(tmp_path: Path, peakmark: Run) -> None:
    write_film(tmp_path / "f.avi", list(np.random.default_rng(0).integers(0, 255, (12, 96, 128), dtype=np.uint8)))
    whole = (tmp_path / "f.avi").read_bytes()
    (tmp_path / "f.avi").write_bytes(whole[: len(whole) // 2] + bytes(len(whole) - len(whole) // 2))
    done = peakmark("detect", tmp_path / "f.avi", "--out", tmp_path / "out", "--quiet")
    assert done.returncode == 1
    assert "f.avi: expected a film, damaged: it states 1.2 s" in done.stderr
    result = json.loads((tmp_path / "out" / "result.json").read_text(encoding="utf-8"))
    assert 0 < len(result["pictures"]) < 12
    assert [one["name"] for one in result["failed"]] == ["f.avi"]


def test_a_run_that_is_stopped_midway_leaves_its_summary(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    for name in ("a", "b"):
        Image.fromarray(GRAY).save(tmp_path / "in" / f"{name}.png")

    def stop(one: object) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        detect_files(tmp_path / "in", tmp_path / "out", on_image=stop)
    result = json.loads((tmp_path / "out" / "result.json").read_text(encoding="utf-8"))
    assert [one["name"] for one in result["pictures"]] == ["a"]


def test_an_image_on_which_the_detector_fails_is_left_out(tmp_path: Path) -> None:
    for name, rows in (("a", 96), ("b", 95)):
        Image.fromarray(GRAY[:rows]).save(tmp_path / f"{name}.png")
    failures: list[FailedFile] = []
    parameters = {"mask": np.ones(GRAY.shape, dtype=bool)}
    records = detect_files(tmp_path, tmp_path / "out", parameters=parameters, on_failure=failures.append)
    assert [record.name for record in records] == ["a"]
    assert [one.name for one in failures] == ["b"]
    assert "mask" in failures[0].reason


def test_key_points_called_result_do_not_become_the_summary(tmp_path: Path) -> None:
    Image.fromarray(GRAY).save(tmp_path / "result.png")
    with pytest.raises(InputError, match=r"result: expected --format npz or csv, as result\.json is the summary"):
        detect_files(tmp_path, tmp_path / "out", ending=".json")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("ending", ["jpg", "tif"])
def test_photographs_are_upright_unless_the_sensors_own_pixels_are_asked_for(
    tmp_path: Path, peakmark: Run, ending: str
) -> None:
    exif = Image.Exif()
    exif[0x0112] = 6
    tags = {"tiffinfo": {0x0112: 6}} if ending == "tif" else {"exif": exif, "quality": 95}
    Image.fromarray(GRAY).save(tmp_path / f"a.{ending}", **tags)
    for options, size in (((), "96×128"), (("--raw-orientation",), "128×96")):
        done = peakmark("detect", tmp_path / f"a.{ending}", "--out", tmp_path / "k.npz", *options)
        assert f"key points in {size} px" in done.stdout, done.stderr


def test_the_eight_and_the_floating_point_image_have_the_same_key_points(tmp_path: Path) -> None:
    Image.fromarray(GRAY).save(tmp_path / "a.tif")
    Image.fromarray(GRAY.astype(np.float32) / np.float32(255)).save(tmp_path / "b.tif")
    Image.fromarray(GRAY.astype(np.uint16) * 257).save(tmp_path / "c.tif")
    counts = {record.keypoints for record in detect_files(tmp_path, tmp_path / "out")}
    assert counts == {len(surf.detect_and_describe(GRAY))} != {0}


@pytest.mark.parametrize("encoding", ["ascii", "utf-8"])
def test_a_terminal_of_another_encoding_and_names_of_no_encoding(tmp_path: Path, encoding: str) -> None:
    (tmp_path / "in").mkdir()
    for name in (b"a.png", b"b\xff\x1b[31m.png"):
        Image.fromarray(GRAY).save(tmp_path / "a.png")
        os.rename(tmp_path / "a.png", os.fsencode(tmp_path / "in") + b"/" + name)
    command = [sys.executable, "-m", "peakmark.cli", "detect", str(tmp_path / "in"), "--out", str(tmp_path / "out")]
    environment = {**os.environ, "PYTHONPATH": SOURCES, "PYTHONIOENCODING": f"{encoding}:strict"}
    done = subprocess.run(command, capture_output=True, check=False, env=environment, timeout=300)
    assert done.returncode == 0, done.stderr
    assert done.stderr == b""
    assert len(done.stdout.splitlines()) == 2
    assert b"\x1b" not in done.stdout
    assert b"b\\udcff\\x1b[31m: " in done.stdout
    result = json.loads((tmp_path / "out" / "result.json").read_bytes())
    assert [one["name"] for one in result["pictures"]] == ["a", "b\udcff\x1b[31m"]
