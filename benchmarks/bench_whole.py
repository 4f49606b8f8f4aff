"""What users wait for, beside others' programs on the same frames: `make bench` prints it.

`python benchmarks/bench_whole.py` prints processor time, median of alternating runs, and its ratio to ours: identify
and the tag detectors on one frame, a first answer, 12 megapixels, a dense wall, rendered frames, corpora, a flight.
"""

import argparse
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from statistics import median
from time import process_time

import cv2
import numpy as np
from numpy.typing import NDArray
from peaksim import Scene, load_scene, render
from peaksim.area.integrate import integrate
from peaksim.camera.camera import Camera, resized
from peaksim.corpus import load_spec, make_corpus
from peaksim.gl import textured
from rich.console import Console
from rich.table import Table

from peakmark import identify, surf
from peakmark.detectors.registry import has_opencv_surf
from peakmark.experiments.comparison.frames import View, clean_shot
from peakmark.experiments.comparison.readers import READERS
from peakmark.experiments.floor.flight import FlightConfig, open_flight, render_view, stretch_of
from peakmark.markers.patterns import surf_marker

ROOT = Path(__file__).resolve().parent.parent
Gray = NDArray[np.uint8]
Jobs = dict[str, Callable[[], object]]

FIRST = "import numpy as np, sys, peakmark; peakmark.identify(np.load(sys.argv[1]))"
CORPUS_FRAMES = 24
"""100 ms a frame are 20 frames a second of two workers."""
MEMORY = FIRST + "; print([line for line in open('/proc/self/status') if line.startswith('VmRSS')][0].split()[1])"


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=5, help="alternating runs of each, after one")
    arguments = parser.parse_args()
    table = Table("what", "who", "CPU ms", "over ours", "wanted")
    with tempfile.TemporaryDirectory() as folder:
        for what, wanted, jobs in rows(Path(folder)):
            times = alternate(jobs, arguments.rounds)
            ours = next(iter(times.values()))
            for k, (who, seconds) in enumerate(times.items()):
                head = (what, wanted) if k == 0 else ("", "")
                table.add_row(head[0], who, f"{1e3 * seconds:.1f}", f"{seconds / ours:.2f}", head[1])
        resident = f"{resident_mb(Path(folder)):.0f} MB"
    table.add_row("resident after identify at VGA", "peakmark", resident, "", "≤ 120 MB")
    Console(width=120).print(table)


def rows(folder: Path) -> list[tuple[str, str, Jobs]]:
    """Return what is measured, what is wanted, and who does it, ours first."""
    frame = clean_shot(View(), np.random.default_rng(0)).gray
    np.save(folder / "frame.npy", frame)
    large = np.asarray(cv2.resize(frame, (4000, 3000), interpolation=cv2.INTER_CUBIC), dtype=np.uint8)
    tags = {
        reader.name: reader.open() for reader in READERS if reader.package != "peakmark" and reader.design != "ring"
    }
    scene, camera, trajectory = load_scene("floor")
    small, pose = resized(camera, 640 / camera.width), trajectory.at(0.0)
    return [
        ("import peakmark, fresh process", "≤ 50 ms", {"peakmark": lambda: fresh("import peakmark", folder)}),
        ("first identify, fresh process", "≤ 1000 ms", {"peakmark": lambda: fresh(FIRST, folder)}),
        (
            "one VGA frame, 48 prints",
            "≤ AprilTag-C",
            {"identify": lambda: identify(frame), **{name: _on(read, frame) for name, read in tags.items()}},
        ),
        ("12 megapixels", "≤ 700 ms", {"identify": lambda: identify(large)}),
        ("dense wall, 1 800 markers", "≤ 3000 ms", {"identify": _on(identify, dense_wall())}),
        (
            "SURF, 1024×768: detect + describe",
            "OpenCV × 1/8",
            surf_jobs(np.asarray(cv2.resize(frame, (1024, 768)), dtype=np.uint8)),
        ),
        ("hall 640×480, exact", "≤ 45 ms", hall()),
        ("floor 640×480", "≤ 0.5 of pyrender 4×4", rendered(scene, small, pose)),
        ("floor 2048×1536", "≤ 0.35 of pyrender 4×4", rendered(scene, camera, pose)),
        ("flight 640×480: render + identify(image)", "≤ 200 ms", {"peakmark": lambda: fly(scene, small, pose)}),
        ("frame of `peakmark fly`, 640×480, scored", "≤ 200 ms", {"peakmark": flight_frame(640)}),
        ("frame of `peakmark fly`, 2048×1536, scored", "≤ 1000 ms", {"peakmark": flight_frame(2048)}),
        (f"{CORPUS_FRAMES} frames of a corpus, 640×480", "≤ 2400 ms", {"peakmark": lambda: corpus(folder)}),
    ]


def _on(work: Callable[[Gray], object], image: Gray) -> Callable[[], object]:
    return lambda: work(image)


def dense_wall() -> Gray:
    """Return an image of 45 × 40 dark and light markers of 24 px, one step of 36 px apart."""
    wall = np.full((40 * 36 + 12, 45 * 36 + 12), 230, np.uint8)
    for k in range(1800):
        row, column = divmod(k, 45)
        tile = surf_marker(24, "light" if (row + column) % 3 == 0 else "dark")
        wall[12 + 36 * row : 36 + 36 * row, 12 + 36 * column : 36 + 36 * column] = tile
    return np.asarray(cv2.GaussianBlur(wall, (0, 0), 0.6), dtype=np.uint8)


def fly(scene: Scene, camera: Camera, pose: NDArray[np.float64]) -> object:
    """Render a frame and find its markers."""
    return identify(render(scene, camera, pose, "exact").image)


def surf_jobs(gray: Gray) -> Jobs:
    """Return our SURF and OpenCV's, where cv2 was built with it, else its SIFT."""
    jobs: Jobs = {"peakmark.surf": lambda: surf.detect_and_describe(gray)}
    name = "xfeatures2d.SURF" if has_opencv_surf() else "SIFT"
    theirs = cv2.xfeatures2d.SURF_create(100) if has_opencv_surf() else cv2.SIFT_create()
    return {**jobs, f"OpenCV's {name}": lambda: theirs.detectAndCompute(gray, None)}


def hall() -> Jobs:
    """Return the hall's first frame."""
    scene, camera, trajectory = load_scene("hall")
    small = resized(camera, 640 / camera.width)
    pose = trajectory.at(0.0)
    return {"exact": lambda: integrate(scene, small, pose[None])}


def rendered(scene: Scene, camera: Camera, pose: NDArray[np.float64]) -> Jobs:
    """Return a frame by three renderers."""
    return {
        "exact": lambda: integrate(scene, camera, pose[None]),
        "gl": lambda: render(scene, camera, pose, "gl"),
        "pyrender 4×4": lambda: textured.draw(scene, camera, pose, 16),
    }


def fresh(code: str, folder: Path) -> None:
    """Run code in a process of its own; `process_seconds` counts its children, too."""
    subprocess.run([sys.executable, "-c", code, str(folder / "frame.npy")], check=True, env=_environment())


def flight_frame(width: int) -> Callable[[], object]:
    """Return what a frame of `peakmark fly` takes, so wide: rendered, detected, identified and scored."""
    flight = open_flight(FlightConfig(renderer="exact"))
    camera = resized(flight.ride.camera, width / flight.ride.camera.width)
    ride = replace(flight.ride, camera=camera)
    wide = replace(flight, ride=ride, stretch=stretch_of(flight.config, ride))
    return lambda: render_view(wide, 0)


def corpus(folder: Path) -> None:
    """Make a small corpus with everything varied and full truth, by the exact renderer: PNG files, shards, tables."""
    text = (ROOT / "scenes" / "experiments" / "corpus_small.toml").read_text(encoding="utf-8")
    text = text.replace("width = 320", "width = 640").replace("height = 240", "height = 480")
    text = text.replace("fx = [300, 400]", "fx = [600, 800]").replace("fx = 200", "fx = 400")
    (folder / "corpus.toml").write_text(f'renderer = "exact"\n{text}', encoding="utf-8")
    with tempfile.TemporaryDirectory(dir=folder) as out:
        make_corpus(load_spec(folder / "corpus.toml", frames=CORPUS_FRAMES), folder, out)


def resident_mb(folder: Path) -> float:
    """Return what a fresh process holds after one identify, 10⁶ bytes."""
    frame = folder / "frame.npy"
    if not frame.exists():
        np.save(frame, clean_shot(View(), np.random.default_rng(0)).gray)
    run = subprocess.run(
        [sys.executable, "-c", MEMORY, str(frame)], check=True, env=_environment(), capture_output=True, text=True
    )
    return int(run.stdout.split()[-1]) * 1024 / 1e6


def _environment() -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": os.pathsep.join((str(ROOT / "src"), str(ROOT / "sim")))}


def alternate(jobs: Jobs, rounds: int) -> dict[str, float]:
    """Return the median processor seconds of each job, alternating, after one run that does not count."""
    times: dict[str, list[float]] = {name: [] for name in jobs}
    for each in range(rounds + 1):
        for name, job in jobs.items():
            start = process_seconds()
            job()
            if each:
                times[name].append(process_seconds() - start)
    return {name: median(values) for name, values in times.items()}


def process_seconds() -> float:
    """Return the processor time of this process and of its children that have ended."""
    times = os.times()
    return process_time() + times.children_user + times.children_system


if __name__ == "__main__":
    main()
