"""Flies a flight and writes what it found: records, tables, poses, film, report.html and result.json."""

import shutil
from collections.abc import Sequence
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
from peaksim.extras import needs_extra
from peaksim.image_file import read_image
from peaksim.whole_file import whole_file
from PIL import Image

from peakmark.experiments.floor import flight_report
from peakmark.experiments.floor.flight import Flight, FlightConfig, open_flight, render_view
from peakmark.experiments.floor.flight_figures import FlightResult, summarise
from peakmark.experiments.floor.flight_recording import record_flight
from peakmark.experiments.floor.flight_records import FrameRecord, columns, record_of
from peakmark.experiments.floor.flight_tracking import Flown, FlownFrame, distances, track_frames, true_distances
from peakmark.experiments.journal import Journal, journal_key
from peakmark.experiments.run import OnStep, run_items
from peakmark.plain import from_plain, to_plain
from peakmark.recording.recorder import check_recording
from peakmark.report import plots
from peakmark.report.film import WIDTH_PX, film
from peakmark.report.results import result_folder, write_json, write_rows
from peakmark.report.trajectory_file import write_known_poses
from peakmark.report.trajectory_view import has_trajectory_view

FRAMES = "frames"
"""Folder of the drawings of each frame, where they are asked for."""

_QUALITY = 85
"""Of the JPEG images that become the film: their loss is small beside the film's own."""


def run_flight(
    config: FlightConfig,
    out: str | Path,
    is_resumed: bool = False,
    on_step: OnStep = lambda done, of: None,
    record: Path | None = None,
    overlays: bool = False,
) -> FlightResult:
    """Fly, write everything into `out`, and return what `result.json` holds.

    `on_step` is called with the numbers of finished and of all frames, when the flight is loaded and after each frame.
    An interrupted flight leaves a journal of its finished frames in `out`; with `is_resumed` only the others are done.
    `record` gets a recording, for which each frame is rendered again, and `overlays` keeps the drawing of each frame
    in `out`/frames.

    Raises
    ------
    InputError
        For a faulty configuration, scene, trajectory or folder, and where `out` holds frames of another flight.
    """
    if record is not None:
        check_recording(record)
    flown, result, journal = fly_and_keep(config, out, is_resumed, on_step, overlays)
    if record is not None:
        record_flight(record, open_flight(config), flown)
    journal.remove()
    return result


def fly_and_keep(
    config: FlightConfig,
    out: str | Path,
    is_resumed: bool = False,
    on_step: OnStep = lambda done, of: None,
    overlays: bool = False,
) -> tuple[Flown, FlightResult, Journal]:
    """Do as `run_flight`, but keep the journal, so that a flight that is finished need not be flown again."""
    flight = open_flight(config)
    journal = Journal.open(out, _identity(flight), is_resumed)
    names = [f"{index:06d}" for index in range(len(flight.times_s))]
    plain = run_items(journal, names, partial(_fly_frame, flight, journal), on_step=on_step)
    records = [from_plain(FrameRecord, record) for record in plain]
    camera, floor_map = flight.ride.camera, flight.floor_map
    frames = track_frames(records, camera, floor_map)
    flown = Flown(Path(out).name, camera, flight.stretch, flight.times_s, floor_map, frames)
    result = summarise(flown, flight)
    if _WRITTEN not in journal.records:
        with result_folder(out) as folder:
            images = [journal.file(f"{name}.jpg") for name in names]
            if overlays:
                _keep(images, folder / FRAMES)
            drawings = [f"{FRAMES}/{path.name}" for path in images] if overlays else []
            _write(folder, flight, flown, result, images, drawings)
        journal.add(_WRITTEN, True)
        journal.remove_files()
    return flown, result, journal


def _keep(images: Sequence[Path], folder: Path) -> None:
    """Copy the drawings of all frames into a folder."""
    folder.mkdir()
    for path in images:
        shutil.copyfile(path, folder / path.name)


_WRITTEN = "results"
"""Name in the journal that says that the results are there."""


def _identity(flight: Flight) -> dict[str, Any]:
    poses = np.ascontiguousarray(flight.ride.trajectory.world_from_camera)
    return {
        **journal_key(flight.config),
        "camera": journal_key(flight.ride.camera),
        "poses_sha256": sha256(poses.tobytes()).hexdigest(),
    }


def _fly_frame(flight: Flight, journal: Journal, index: int) -> FrameRecord:
    view = render_view(flight, index)
    with whole_file(journal.file(f"{index:06d}.jpg")) as path:
        Image.fromarray(view.overlay()).save(path, "JPEG", quality=_QUALITY)
    return record_of(view)


def _write(
    folder: Path, flight: Flight, flown: Flown, result: FlightResult, images: Sequence[Path], drawings: Sequence[str]
) -> None:
    """Write all files; `drawings` are the images where they are kept, as names beside the report."""
    write_rows(folder / "frames.csv", [frame_row(frame) for frame in flown.frames])
    write_detections(folder / "detections.parquet", flown, flight.marker_names)
    _write_poses(folder, flown)
    with film(folder / "flight.mp4", flight.ride.frames_per_second, WIDTH_PX) as append:
        for path in images:
            append(read_image(path))
    if flown.floor_map is not None:
        figure, ax = plots.new_figure(7, 7)
        flight_report.draw_top_view(ax, flown)
        plots.save(figure, folder / "top_view.png")
        if has_trajectory_view():
            flight_report.write_trajectory_page(folder / flight_report.TRAJECTORY_PAGE, flown, drawings)
    flight_report.write_flight_report(folder / "report.html", flown, result, drawings)
    write_json(folder / "result.json", result)


def frame_row(frame: FlownFrame) -> dict[str, Any]:
    """Return one frame's line of frames.csv."""
    record, located = frame.record, frame.located
    return {
        "frame": record.frame,
        "time_on_path_s": record.time_on_path_s,
        "features": record.features,
        **to_plain(record.score),
        "tracks": frame.track_ids,
        "pose": {
            "found": "none" if located is None else "tracked" if frame.is_tracked else "alone",
            "markers": 0 if located is None else int((located.marker_of >= 0).sum()),
            **_errors(frame.map_error),
            "is_wrong": int(frame.is_wrong),
        },
        "motion": _errors(frame.motion_error),
        "time_s": record.time_s,
    }


def _errors(error: tuple[float, float] | None) -> dict[str, float | None]:
    return dict(zip(("error_mm", "error_deg"), error or (None, None), strict=True))


_COPIED = ("explained", "response", "signature_distance", "rank")
_COLUMNS = (
    *("frame", "time_s", "track", "truth", "map_marker", "x", "y", "side_px", "a11", "a12", "a21", "a22", *_COPIED),
    *("feature_x", "feature_y", "scale_px", "rounded_scale_px"),
    *("distance_rounded_m", "distance_scale_m", "distance_refined_m", "true_distance_m"),
)
"""Of detections.parquet."""


@needs_extra
def write_detections(path: Path, flown: Flown, marker_names: Sequence[str]) -> None:
    """Write one row a detection of all frames; the schema is the same for any flight, empty ones included."""
    import pyarrow as pa
    from pyarrow import parquet

    kinds = {"truth": pa.string(), "map_marker": pa.string(), **dict.fromkeys(("frame", "track", "rank"), pa.int64())}
    schema = pa.schema([(name, kinds.get(name, pa.float64())) for name in _COLUMNS])
    heights = flown.heights_m.tolist()
    rows = [
        row
        for frame, height in zip(flown.frames, heights, strict=True)
        for row in _detection_rows(flown, frame, height, marker_names)
    ]
    parquet.write_table(pa.Table.from_pylist(rows, schema), path)


def _detection_rows(flown: Flown, frame: FlownFrame, height_m: float, names: Sequence[str]) -> list[dict[str, Any]]:
    record, table = frame.record, columns(frame.record)
    found, true = distances(record, flown.camera, flown.floor_map, height_m), true_distances(record)
    on_map = np.full(len(record.detections), -1)
    if frame.located is not None:
        on_map[table.refined] = frame.located.marker_of
    return [
        {
            "frame": record.frame,
            "time_s": record.time_on_path_s,
            "track": int(frame.track_ids[k]),
            "truth": row.marker,
            "map_marker": None if on_map[k] < 0 else names[on_map[k]],
            **dict(zip("xy", row.detection.xy, strict=True)),
            "side_px": row.detection.size,
            **{f"a{i + 1}{j + 1}": _number(table.affinity[k, i, j]) for i in (0, 1) for j in (0, 1)},
            **{name: getattr(row.detection, name) for name in _COPIED},
            **dict(zip(("feature_x", "feature_y"), row.feature_xy, strict=True)),
            "scale_px": row.scale_px,
            "rounded_scale_px": row.rounded_scale_px,
            **{f"distance_{name}_m": _number(values[k]) for name, values in found.items()},
            "true_distance_m": _number(true[k]),
        }
        for k, row in enumerate(record.detections)
    ]


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _write_poses(folder: Path, flown: Flown) -> None:
    """Write truth.tum, and map.tum and motion.tum where any frame has such a pose."""
    for name, poses in flown.trajectories.items():
        write_known_poses(folder / f"{name}.tum", flown.times_s, poses)
