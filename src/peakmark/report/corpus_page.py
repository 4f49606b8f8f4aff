"""A corpus to look at: images with their markers drawn in, a page of them, and a recording for Rerun."""

import webbrowser
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from peaksim.camera.camera import Camera
from peaksim.corpus.read import Corpus, open_corpus
from peaksim.corpus.sample import Record, marker_outlines
from PIL import Image

from peakmark.errors import InputError
from peakmark.recording.rerun_file import log_camera
from peakmark.report.overlay import draw_circle, draw_outline, rgb_copy
from peakmark.report.page import Section, Table, jpeg_uri, write_report
from peakmark.report.results import result_folder

_SHOWN = 12  # frames, unless some are named

_COLOURS = ((150, 150, 150), (255, 140, 0), (60, 220, 60))
"""RGB of points outside the image, covered, and seen."""


def show_frames(dest: str, frames: Sequence[int] | None, out: Path) -> Path:
    """Write an image of each frame of a corpus and index.html; return the page."""
    corpus = open_corpus(dest)
    sections = []
    with result_folder(out) as folder:
        for frame in _chosen(corpus, frames):
            record = corpus.record(frame)
            image = draw_truth(corpus.picture(frame), record)
            Image.fromarray(image).save(folder / f"{frame:08d}.png")
            sections.append(_section(frame, record, image))
        spec = corpus.configuration.spec
        lead = f"{len(corpus)} frames, seed {spec.seed}, renderer {corpus.configuration.renderer}."
        write_report(folder / "index.html", f"Corpus {spec.name}", lead, sections)
    return out / "index.html"


def _chosen(corpus: Corpus, frames: Sequence[int] | None) -> list[int]:
    """Return the frames that were named, or some in even steps."""
    steps = np.linspace(0, len(corpus) - 1, min(_SHOWN, len(corpus)))
    return list(frames) if frames is not None else [round(float(step)) for step in steps]


def draw_truth(image: NDArray[np.uint8], record: Record) -> NDArray[np.uint8]:
    """Return an RGB copy, enlarged where small, with each marker's outline, points and name."""
    scale = max(1, round(900 / image.shape[1]))
    canvas = rgb_copy(image).repeat(scale, axis=0).repeat(scale, axis=1)
    for marker in record["markers"]:
        points = np.array([xy if None not in xy else (np.nan, np.nan) for xy in marker["points_xy"]], dtype=np.float64)
        points = (points + 0.5) * scale - 0.5
        colour = _COLOURS[2] if marker["visible_fraction"] > 0 else _COLOURS[1]
        outline = points[1:]
        if not np.isfinite(points).all():
            outline = (marker_outlines(record, [marker])[0] + 0.5) * scale - 0.5
        if len(outline):
            draw_outline(canvas, outline, colour, 1)
        for xy, state in zip(points, marker["points_seen"], strict=True):
            if state:
                draw_circle(canvas, xy, 3, _COLOURS[state], -1)
        if marker["points_seen"][0]:
            start = (int(points[0, 0]) + 6, int(points[0, 1]))
            cv2.putText(canvas, marker["name"], start, cv2.FONT_HERSHEY_SIMPLEX, 0.45, (255, 255, 0), 1, cv2.LINE_AA)
    return canvas


def _section(frame: int, record: Record, image: NDArray[np.uint8]) -> Section:
    head = ("marker", "kind", "side (px)", "distance (m)", "tilt (°)", "visible")
    rows = [
        (m["name"], m["kind"], m["side_px"], m["distance_m"], m["tilt_deg"], m["visible_fraction"])
        for m in record["markers"]
    ]
    caption = f"Camera {record['camera']['name']}, scene {record['scene']}, view {record['view']}."
    return Section(f"Frame {frame}", table=Table(head, rows), image=jpeg_uri(image), caption=caption)


def open_page(page: Path) -> None:
    """Open a page in the user's browser; without one an `InputError`."""
    if not webbrowser.open(page.resolve().as_uri()):
        raise InputError(f"--open: found no browser to open {page} with")


# --- Rerun ------------------------------------------------------------------------------------------------------


def save_recording(dest: str, frames: Sequence[int] | None, path: Path) -> None:
    """Write a Rerun recording (.rrd): cameras and marker points in the world, images and points in the camera.

    Rerun is an extra: an `InputError` says that it is not installed, or that the file cannot be written.
    """
    try:
        import rerun as rr
    except ImportError as error:
        raise InputError("--rrd: needs rerun: pip install 'peakmark[rerun]'") from error
    corpus = open_corpus(dest)
    recording = rr.RecordingStream("peakmark corpus")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        recording.save(path)
    except OSError as error:
        raise InputError(f"--rrd {path}: cannot be written: {error.strerror or error}") from error
    for frame in _chosen(corpus, frames):
        recording.set_time("frame", sequence=frame)
        _log_frame(rr, recording, corpus.record(frame), corpus.picture(frame))
    recording.flush()


def _log_frame(rr: Any, recording: Any, record: Record, image: NDArray[np.uint8]) -> None:
    points = [
        (xyz, xy, state, marker["name"])
        for marker in record["markers"]
        for xyz, xy, state in zip(marker["points_world_m"], marker["points_xy"], marker["points_seen"], strict=True)
    ]
    shown = [p for p in points if p[2]]
    recording.log("world/markers", rr.Points3D([p[0] for p in points], radii=0.005))
    camera = Camera(**{name: record["camera"][name] for name in ("width", "height", "fx", "fy", "cx", "cy")})
    log_camera(rr, recording, camera, np.array(record["world_from_camera"]))
    recording.log("world/camera/picture", rr.Image(image))
    recording.log(
        "world/camera/picture/points",
        rr.Points2D(np.array([p[1] for p in shown]).reshape(-1, 2) + 0.5, labels=[p[3] for p in shown], radii=2),
    )
