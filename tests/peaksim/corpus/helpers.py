"""A tiny scene and specification: a plain room with three markers, images of 64×48 px, milliseconds a frame."""

import os
import subprocess
import sys
import time
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from peaksim.corpus.spec import CorpusSpec, spec_to_json
from peaksim.corpus.store.base import Writing
from peaksim.errors import InputError

from tests.places import ROOT

SCENE = """
[camera]
width = 64
height = 48
fx = 50.0

[sensor]
read_noise = 1.0

[[trajectory]]
time_s = 0.0
eye_m = [-0.5, -0.8, 0.8]
target_m = [0.0, 0.2, 0.0]

[[trajectory]]
time_s = 2.0
eye_m = [0.5, -0.8, 0.8]
target_m = [0.0, 0.2, 0.0]

[textures.floor]
variants = { plain = "plain.png", striped = "striped.png" }
photo_m = 0.5

[textures.wall]
level = 200

[room]
min_m = [-1.0, -1.0, 0.0]
max_m = [1.0, 1.0, 1.5]
floor = "floor"
walls = "wall"

[[markers]]
name = "left"
kind = "surf-dark"
side_m = 0.2
border_m = 0.02
center_m = [-0.3, 0.0, 0.001]

[[markers]]
name = "right"
kind = "surf-light"
side_m = 0.2
border_m = 0.02
center_m = [0.3, 0.0, 0.001]

[[markers]]
name = "wall"
kind = "surf-dark"
side_m = 0.3
border_m = 0.03
center_m = [0.0, 0.99, 0.5]
normal = [0.0, -1.0, 0.0]
up = [0.0, 0.0, 1.0]
"""


BASE: dict[str, Any] = {
    "name": "tiny",
    "frames": 12,
    "seed": 5,
    "sequence_frames": 4,
    "renderer": "exact",
    "store": {"shard_frames": 3, "part_frames": 6},
    "scenes": [{"file": "tiny.toml"}],
    "cameras": [{"name": "cam", "width": 64, "height": 48, "fx": [50, 60]}],
    "views": [{"kind": "marker", "distance_m": [0.5, 1.0]}],
    "sensor": {"read_noise": [0, 2]},
}


def tiny_spec(**fields: Any) -> CorpusSpec:
    """Return the tiny specification with some fields replaced."""
    return CorpusSpec.model_validate({**BASE, **fields})


def write_tiny_scene(folder: Path) -> Path:
    """Write tiny.toml and its images."""
    folder.mkdir(exist_ok=True)
    (folder / "tiny.toml").write_text(SCENE, encoding="utf-8")
    cv2.imwrite(str(folder / "plain.png"), np.full((8, 8), 150, np.uint8))
    cv2.imwrite(str(folder / "striped.png"), np.tile(np.array([[90, 210]], np.uint8), (8, 4)))
    return folder


def tiny_records(spec: CorpusSpec, folder: Path) -> list[dict[str, Any]]:
    """Return the records of a specification's frames."""
    from peaksim.corpus.plan import plan_frame
    from peaksim.corpus.sample import from_line, make_sample

    samples = (make_sample(plan_frame(spec, folder, i), "exact", spec.pictures) for i in range(spec.frames))
    return [from_line(sample.record, "record") for sample in samples]


class MemoryFile(Writing):
    """A file that is written in memory."""

    def __init__(self) -> None:
        self.buffer = BytesIO()
        super().__init__(self.buffer)


def contents(folder: Path) -> dict[str, bytes]:
    """Return every file below a folder by its relative name."""
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def run_make(spec: CorpusSpec, folder: Path, dest: Path, *arguments: str) -> subprocess.Popen[bytes]:
    """Start a process that makes a corpus of a specification: the same code, as a program that can be killed.

    It complains into a file, `complaints(dest)`: a pipe would stay open as long as any process that it started.
    """
    code = "import sys; from tests.peaksim.corpus.helpers import make_from_arguments; make_from_arguments(sys.argv[1:])"
    command = [sys.executable, "-c", code, spec_to_json(spec), str(folder), str(dest), *arguments]
    with complaints(dest).open("ab") as errors:
        return subprocess.Popen(command, env=child_environment(), stderr=errors, start_new_session=True)


def complaints(dest: Path) -> Path:
    """Return the file beside a corpus with what `run_make` wrote to stderr."""
    return dest.with_suffix(".stderr")


def make_from_arguments(arguments: list[str]) -> None:
    """Make a corpus: specification as JSON, folder, destination and optionally the number of worker processes."""
    from peaksim.corpus import in_process, make_corpus, processes
    from peaksim.corpus.spec import spec_from_json

    spec, folder, dest, *workers = arguments
    backend = processes(int(workers[0])) if workers else in_process()
    try:
        make_corpus(spec_from_json(spec), Path(folder), dest, backend)
    except InputError as error:
        sys.exit(f"error: {error}")


def make_on_scheduler(spec: Path, folder: Path, dest: str, address: str) -> None:
    """Make a corpus slowly enough for its scheduler to be killed meanwhile."""
    from peaksim.corpus import make_corpus, on_dask
    from peaksim.corpus.spec import spec_from_json

    make_corpus(spec_from_json(spec.read_text()), folder, dest, on_dask(address), lambda frames: time.sleep(0.1))


def wait_until(condition: Callable[[], bool], limit_s: float = 120.0) -> None:
    """Return as soon as a condition holds; fail if it takes too long."""
    deadline = time.monotonic() + limit_s
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.02)


def is_alive(pid: int) -> bool:
    """Return whether a process runs; one that has ended and waits to be collected does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


def child_environment() -> dict[str, str]:
    """Return an environment in which a child process finds this checkout and its tests."""
    paths = [ROOT / "src", ROOT / "sim", ROOT]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, paths))}
