"""Records that are made up, and a small corpus of the floor that real detectors run on."""

from dataclasses import replace
from pathlib import Path
from typing import Any

from peaksim.corpus import make_corpus
from peaksim.corpus.spec import CorpusSpec

from peakmark.regress.detector import DetectorSettings
from peakmark.regress.frame import ScoredFrame, ScoredMarker
from peakmark.regress.record import Record

SMALL = {
    "name": "small",
    "frames": 20,
    "seed": 3,
    "sequence_frames": 4,
    "renderer": "exact",
    "scenes": [{"file": "floor"}],
    "cameras": [{"name": "cam", "width": 320, "height": 240, "fx": 400}],
    "views": [
        {"kind": "marker", "distance_m": {"log_uniform": [0.19, 0.4]}, "tilt_deg": [0, 40], "off_axis": [0, 0.3]}
    ],
    "sensor": {"lens_blur_px": 0.5, "read_noise": 2},
}


def make_small_corpus(folder: Path) -> str:
    """Make 20 images of 320×240 around markers of the floor, with sides of 80 to 168 px."""
    make_corpus(CorpusSpec.model_validate(SMALL), folder, str(folder / "small"))
    return str(folder / "small")


def marker(x: float = 50.0, error: float = 0.1, side: float = 30.0, **fields: Any) -> ScoredMarker:
    """Return a dark marker that was found `error` px right of its centre."""
    values = {"xy": (x + error, 20.0), "response": 1000.0, "polarity_is_right": True, **fields}
    return ScoredMarker(side, (x, 20.0), **values)


def missed(side: float = 30.0) -> ScoredMarker:
    """Return a marker that was not found."""
    return ScoredMarker(side, (50.0, 20.0))


def frame(index: int, *markers: ScoredMarker, **fields: Any) -> ScoredFrame:
    """Return a frame with markers a, b, …."""
    named = {chr(ord("a") + i): m for i, m in enumerate(markers)}
    values = {"features": 500, "false_xy": (), "drop": 2.0, **fields}
    return ScoredFrame(index, f"{index:016x}", markers=named, **values)


def record(*frames: ScoredFrame, **fields: Any) -> Record:
    """Return a run's record."""
    made = Record("made-up", "0" * 64, DetectorSettings(), 1, "exact", {"peakmark": "0.1.0"}, {}, frames)
    return replace(made, **fields)


def sound(frames: int = 20) -> Record:
    """Return a run in which two markers a frame were found."""
    return record(*(frame(i, marker(error=0.01 * (i % 5)), marker(90.0, side=60.0)) for i in range(frames)))
