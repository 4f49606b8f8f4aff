"""`peakmark identify`: what it reads, what it says, what it writes, and how an interrupted run resumes."""

import csv
import os
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from peakmark.cli.film_file import read_film
from peakmark.errors import one_line
from tests.helpers import marker_view
from tests.peakmark.cli.films import write_film
from tests.peakmark.cli.running import Run, runner
from tests.peakmark.identification.sift_wall import wall
from tests.places import SOURCES

DARK, LIGHT, EMPTY = marker_view(48), marker_view(60, polarity="light"), np.full((257, 257), 128, np.uint8)


@pytest.fixture
def identify(folder: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Run:
    """Return what runs the command in the folder."""
    return partial(runner(folder, monkeypatch, capfd), "identify")


def written(path: Path) -> list[tuple[str, str, str]]:
    """Return file, frame and polarity of each row."""
    with path.open(newline="", encoding="utf-8") as file:
        return [(row["file"], row["frame"], row["polarity"]) for row in csv.DictReader(file)]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a folder with images in a folder, and a film beside it."""
    (tmp_path / "in").mkdir()
    for name, pixels in (("dark", DARK), ("empty", EMPTY), ("light", LIGHT)):
        Image.fromarray(pixels).save(tmp_path / "in" / f"{name}.png")
    even = [np.pad(each, ((0, 1), (0, 1)), "edge") for each in (DARK, EMPTY, LIGHT)]
    write_film(tmp_path / "film.mp4", even)
    return tmp_path


def test_one_image_is_a_table_and_an_empty_one_says_why(folder: Path, identify: Run) -> None:
    done = identify("in/dark.png")
    assert (done.returncode, done.stderr) == (0, "")
    assert "in/dark.png: 1 markers" in done.stdout
    assert "│ marker │      │ dark     │ 128.0" in done.stdout
    done = identify("in/empty.png")
    assert done.returncode == 0
    assert "nothing found: looked for dark and light SURF markers" in done.stdout
    assert "too little contrast" in done.stdout


def test_markers_for_sift_and_binary_ones_are_found_when_they_are_asked_for(folder: Path, identify: Run) -> None:
    image, truth = wall()
    Image.fromarray(image).save(folder / "wall.png")
    done = identify("wall.png", "--detector", "sift", "--limit", "both", "--out", "f.csv")
    assert done.returncode == 0
    with (folder / "f.csv").open(newline="", encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["kind"] == "marker"]
    for kind, xy, _ in truth:
        assert kind.kind in [r["pattern"] for r in rows if np.hypot(float(r["x"]) - xy[0], float(r["y"]) - xy[1]) < 0.2]
    done = identify("in/empty.png", "--detector", "sift", "--limit", "range")
    assert "nothing found: looked for dark and light binary SIFT markers" in done.stdout


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (("--detector", "surf,orb"), "--detector"),
        (("--limit", "paper"), "--limit"),
        (("--detector", "surf-disc", "--limit", "energy"), "--limit: expected range or both with --detector surf-disc"),
    ],
)
def test_unknown_kinds_of_markers_are_one_line(folder: Path, identify: Run, wrong: tuple[str, ...], said: str) -> None:
    done = identify("in/dark.png", *wrong)
    assert done.returncode == 2
    assert done.stderr.startswith("error: " + said)
    assert done.stderr.count("\n") == 1


def test_folders_patterns_films_and_lists_are_one_run(folder: Path, identify: Run) -> None:
    Image.fromarray(DARK).save(folder / "listed.png")
    sources = ("in", "*.mp4", "-", "missing.png")
    done = identify(*sources, "--out", "f.csv", "--overlay", "drawn", stdin="listed.png\n\n")
    assert done.returncode == 1  # for the one that is missing
    assert done.stderr == "error: missing.png: cannot be read: No such file or directory\n"
    expected = [("in/dark.png", "", "dark"), ("in/light.png", "", "light")]
    expected += [("film.mp4", "0", "dark"), ("film.mp4", "2", "light"), ("listed.png", "", "dark")]
    assert written(folder / "f.csv") == expected
    assert "7 images: 5 markers, no arrays; nothing in 2; 1 left out" in done.stdout
    drawn = ["dark.overlay.jpg", "empty.overlay.jpg", "film.overlay.mp4", "light.overlay.jpg", "listed.overlay.jpg"]
    assert sorted(path.name for path in (folder / "drawn").iterdir()) == drawn
    assert len(list(read_film(folder / "drawn" / "film.overlay.mp4"))) == 3
    overlay = np.asarray(Image.open(folder / "drawn" / "dark.overlay.jpg")).astype(int)
    off = np.abs(overlay - DARK[..., None].astype(int)).max(axis=2) > 60
    assert off[100:157, 100:157].sum() > 0.9 * off.sum() > 50  # the outline, and little else
    assert not list(folder.glob("*.unfinished"))


def test_a_second_run_does_not_read_the_drawings_of_the_first(folder: Path, identify: Run) -> None:
    for _ in range(2):
        done = identify("in", "--overlay", "in", "--quiet", "--out", "f.csv")
        assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
        assert [row[0] for row in written(folder / "f.csv")] == ["in/dark.png", "in/light.png"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["missing.png"], "missing.png: cannot be read: No such file or directory"),
        ([], "SOURCE: expected images, folders or films, got none"),
        (["*.gif"], "*.gif: expected a pattern that files match, got none"),
        (["in", "--out", "f.xls"], "--out f.xls: expected a name ending in .csv, .jsonl or .parquet"),
        (["in", "--polarity", "grey"], "--polarity: expected one of dark, light, both, got 'grey'"),
        (["in", "--camera", "0"], "--camera 0: expected a camera or SOURCE, got both"),
        (["--camera", "977"], "--camera 977: expected a camera that can be opened; this machine has"),
        (["in", "--workers", "0"], "--workers: expected 1…1024, got 0"),
        (["in", "--frames", "3"], "--frames 3: expected together with --camera"),
        (["in", "--overlay", "in/dark.png"], "--overlay in/dark.png: expected a folder: File exists"),
    ],
)
def test_bad_input_is_one_line_and_status_2(folder: Path, identify: Run, arguments: list[str], words: str) -> None:
    done = identify(*arguments)
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1
    assert words in done.stderr
    assert sorted(path.name for path in folder.iterdir()) == ["film.mp4", "in"]


def test_a_film_that_ends_midway_keeps_what_was_found(folder: Path, identify: Run) -> None:
    frames = np.random.default_rng(0).integers(0, 255, (12, 258, 258), dtype=np.uint8)
    frames[:, 80:177, 80:177] = DARK[80:177, 80:177]
    write_film(folder / "cut.avi", list(frames))
    whole = (folder / "cut.avi").read_bytes()
    (folder / "cut.avi").write_bytes(whole[: len(whole) // 2])
    done = identify("cut.avi", "--out", "f.csv")
    assert done.returncode == 1
    assert f"cut.avi: expected a film, cut: expected {len(whole)} bytes, got {len(whole) // 2}" in done.stderr
    assert 0 < len(written(folder / "f.csv")) < 12


def test_the_number_of_workers_changes_no_byte(folder: Path, identify: Run) -> None:
    (folder / "in" / "broken.png").write_bytes(b"no image")
    runs = []
    for workers in (1, 3):
        done = identify("in", "film.mp4", "--out", "f.csv", "--overlay", "drawn", "--workers", f"{workers}")
        files = {path.name: path.read_bytes() for path in [folder / "f.csv", *(folder / "drawn").iterdir()]}
        runs.append((done.returncode, done.stdout, done.stderr, files))
    assert runs[0] == runs[1]
    assert runs[0][0] == 1


def test_an_interrupted_run_resumes_and_gives_the_same_rows(folder: Path, identify: Run) -> None:
    for number in range(16):
        Image.fromarray(DARK if number % 2 else LIGHT).save(folder / "in" / f"{number:02d}.png")
    command = [sys.executable, "-m", "peakmark.cli", "identify", "in", "--out", "f.csv"]
    environment = {**os.environ, "PYTHONPATH": SOURCES}
    journal = folder / "f.csv.unfinished" / "journal.jsonl"
    with subprocess.Popen(command, cwd=folder, env=environment, stderr=subprocess.PIPE, text=True) as run:
        for _ in range(3000):
            if run.poll() is not None or (journal.exists() and len(journal.read_text().splitlines()) > 2):
                break
            time.sleep(0.02)
        run.send_signal(signal.SIGINT)
        _, said = run.communicate(timeout=60)
    assert run.returncode == 130
    assert said.splitlines()[-1] == "interrupted: the same command resumes"
    assert not (folder / "f.csv").exists()
    begun = len(journal.read_text().splitlines()) - 1
    assert 0 < begun < 19
    assert identify("in", "--out", "f.csv").returncode == 0
    assert identify("in", "--out", "g.csv").returncode == 0
    assert (folder / "f.csv").read_bytes() == (folder / "g.csv").read_bytes()
    assert len(written(folder / "f.csv")) == 18


def test_a_name_that_a_terminal_would_obey_is_escaped(folder: Path, identify: Run) -> None:
    Image.fromarray(DARK).save(folder / "a\x1b[31m.png")
    done = identify("a\x1b[31m.png")
    assert one_line("a\x1b[31m.png") in done.stdout
    assert "\x1b" not in done.stdout
