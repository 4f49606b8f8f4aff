"""Flies a flight and writes what it found: records, tables, poses, film, report.html and result.json."""

from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from shutil import rmtree
from typing import Any

import numpy as np
from peaksim.geometry.trajectory import Trajectory
from peaksim.geometry.trajectory_file import save_trajectory

from peakmark.experiments.floor import flight_files, flight_report
from peakmark.experiments.floor.flight import Flight, FlightConfig, open_flight, shoot
from peakmark.experiments.floor.flight_course import Step, distances, sight, steps, true_pose, ways
from peakmark.experiments.floor.flight_figures import BINS, figures, has_evo, recall_by
from peakmark.localise.locate import FEWEST
from peakmark.report import plots
from peakmark.report.film import WIDTH_PX, film
from peakmark.report.overlay import draw_overlay
from peakmark.report.results import peak_memory_mb, result_folder, write_json, write_rows
from peakmark.score.poses import is_wrong, pose_error


def run(
    config: FlightConfig, out: str | Path, is_resumed: bool = False, on_step: Callable[[int], None] = lambda total: None
) -> dict[str, Any]:
    """Fly, write everything into `out`, and return what `result.json` holds.

    `on_step` is called with the number of frames when the flight is loaded and after each frame. An interrupted flight
    leaves its finished frames in `out/frames`; with `is_resumed` they are kept and the others done.

    Raises
    ------
    InputError
        For a faulty configuration, scene, trajectory or folder, and where `out` holds frames of another flight.
    """
    flight = open_flight(config)
    count = len(flight.times_s)
    store = flight_files.open_store(out, flight, is_resumed)
    on_step(count)
    for index in range(count):
        if not flight_files.is_done(store, index):
            shot = shoot(flight, index)
            picture = draw_overlay(shot.frame.image, shot.frame.truth, shot.found.detections, shot.score)
            flight_files.save_frame(store, shot.record, picture)
        on_step(count)
    records = [flight_files.load_record(store, index) for index in range(count)]
    course = steps(records, flight.ride.camera, flight.floor_map)
    result = _result(flight, records, course)
    with result_folder(out) as folder:
        _write(folder, flight, store, records, course, result)
    rmtree(store)
    return result


def _result(flight: Flight, records: Sequence[dict[str, Any]], course: Sequence[Step]) -> dict[str, Any]:
    renderer, gl_renderer = records[0]["renderer"]
    return {
        **figures(records, course, flight.times_s, flight.ride.camera, flight.stretch, flight.floor_map),
        "recall_by": {quantity: recall_by(records, quantity) for quantity in BINS},
        "pixels": flight.ride.camera.width * flight.ride.camera.height,
        "remarks": [*remarks(flight), *surprises(records, course)],
        "renderer": renderer,
        "gl_renderer": gl_renderer,
        "config": asdict(flight.config),
        "peak_memory_mb": peak_memory_mb(),
    }


def remarks(flight: Flight) -> list[str]:
    """Return one line for each thing about the flight that makes figures unreliable, or leaves some out."""
    floor_map, step = flight.floor_map, flight.ride.longest_step_m()
    if floor_map is None:
        return ["the markers are not on one level floor: no poses, no motion"]
    notes = [] if has_evo() else ["trajectory errors are left out: they need evo (pip install 'peakmark[evo]')"]
    if len(floor_map.centers_m) < 2:
        return notes
    gaps = np.linalg.norm(floor_map.centers_m[:, None] - floor_map.centers_m[None], axis=2)
    spacing = float(np.min(gaps + np.diag(np.full(len(gaps), np.inf))))
    if step <= spacing / 2:
        return notes
    return [
        *notes,
        f"the camera moves up to {step:.2g} m between frames, more than half the markers' spacing of {spacing:.2g} m: "
        "tracks and motion without a map cannot follow",
    ]


def surprises(records: Sequence[dict[str, Any]], course: Sequence[Step]) -> list[str]:
    """Return one line for each thing about what was seen that makes figures meaningless."""
    if not any(record["truth"] for record in records):
        return ["no marker was in view in any frame"]
    enough = [step for record, step in zip(records, course, strict=True) if len(record["detections"]) >= FEWEST]
    wrong = sum(is_wrong(_map_error(r, s)) for r, s in zip(records, course, strict=True))
    if enough and (all(step.located is None for step in enough) or 2 * wrong > len(enough)):
        return [f"the map does not fit what is seen: most of {len(enough)} frames with {FEWEST} markers say so"]
    return []


def _map_error(record: dict[str, Any], step: Step) -> tuple[float, float] | None:
    return pose_error(None if step.located is None else step.located.world_from_camera, true_pose(record))


def _write(
    folder: Path,
    flight: Flight,
    store: Path,
    records: Sequence[dict[str, Any]],
    course: Sequence[Step],
    result: dict[str, Any],
) -> None:
    rows = [frame_row(record, step) for record, step in zip(records, course, strict=True)]
    write_rows(folder / "frames.csv", rows)
    write_detections(folder / "detections.parquet", flight, records, course)
    _write_poses(folder, flight, records, course)
    with film(folder / "flight.mp4", flight.ride.frames_per_second, WIDTH_PX) as append:
        for index in range(len(records)):
            append(flight_files.load_picture(store, index))
    if flight.floor_map is not None:
        figure, ax = plots.new_figure(7, 7)
        flight_report.draw_top_view(ax, flight, records, course)
        plots.save(figure, folder / "top_view.png")
    flight_report.write(folder / "report.html", flight, records, course, rows, result)
    write_json(folder / "result.json", result)


def frame_row(record: dict[str, Any], step: Step) -> dict[str, Any]:
    """Return one frame's line of frames.csv."""
    error, drift = _map_error(record, step), pose_error(step.moved, true_pose(record))
    return {
        **{name: record[name] for name in ("frame", "time_on_path_s", "features")},
        **record["score"],
        "tracks": " ".join(map(str, step.track_ids)),
        "pose": {
            "found": "none" if step.located is None else "tracked" if step.is_tracked else "alone",
            "markers": 0 if step.located is None else int((step.located.marker_of >= 0).sum()),
            "error_mm": None if error is None else error[0],
            "error_deg": None if error is None else error[1],
            "is_wrong": int(is_wrong(error)),
        },
        "motion": {"error_mm": None if drift is None else drift[0], "error_deg": None if drift is None else drift[1]},
        "time_s": record["time_s"],
    }


def write_detections(path: Path, flight: Flight, records: Sequence[dict[str, Any]], course: Sequence[Step]) -> None:
    """Write one row a detection of all frames; the schema is the same for any flight, empty ones included."""
    import pyarrow as pa
    from pyarrow import parquet

    text, number, whole = pa.string(), pa.float64(), pa.int64()
    schema = pa.schema(
        [("frame", whole), ("time_s", number), ("track", whole), ("truth", text), ("map_marker", text)]
        + [(name, number) for name in ("x", "y", "side_px", "a11", "a12", "a21", "a22", "explained", "response")]
        + [("signature_distance", number), ("rank", whole)]
        + [(name, number) for name in ("feature_x", "feature_y", "scale_px", "rounded_scale_px")]
        + [
            (name, number)
            for name in ("distance_rounded_m", "distance_scale_m", "distance_refined_m", "true_distance_m")
        ]
    )
    rows = [row for record, step in zip(records, course, strict=True) for row in detection_rows(flight, record, step)]
    parquet.write_table(pa.Table.from_pylist(rows, schema), path)


def detection_rows(flight: Flight, record: dict[str, Any], step: Step) -> list[dict[str, Any]]:
    """Return one frame's rows of detections.parquet."""
    seen = sight(record)
    true = {truth["name"]: truth["distance_m"] for truth in record["truth"]}
    found: dict[str, Any] = {}
    if flight.floor_map is not None:
        height = float(true_pose(record)[2, 3] - flight.floor_map.centers_m[0, 2])
        found = distances(seen, record, flight.ride.camera, flight.floor_map.side_m, height)
    on_map = np.full(len(seen.xy), -1)
    if step.located is not None:
        on_map[seen.refined] = step.located.marker_of
    return [
        {
            "frame": record["frame"],
            "time_s": record["time_on_path_s"],
            "track": int(step.track_ids[k]),
            "truth": row["truth"],
            "map_marker": None if on_map[k] < 0 else flight.marker_names[on_map[k]],
            "x": row["xy"][0],
            "y": row["xy"][1],
            "side_px": row["side_px"],
            **{f"a{i + 1}{j + 1}": _number(seen.affinity[k, i, j]) for i in (0, 1) for j in (0, 1)},
            **{name: row[name] for name in ("explained", "response", "signature_distance", "rank")},
            "feature_x": row["feature_xy"][0],
            "feature_y": row["feature_xy"][1],
            "scale_px": row["scale_px"],
            "rounded_scale_px": row["rounded_scale_px"],
            **{f"distance_{name}_m": _number(values[k]) for name, values in found.items()},
            "true_distance_m": true.get(row["truth"]),
        }
        for k, row in enumerate(record["detections"])
    ]


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _write_poses(folder: Path, flight: Flight, records: Sequence[dict[str, Any]], course: Sequence[Step]) -> None:
    """Write truth.tum, and map.tum and motion.tum where any frame has such a pose."""
    for name, poses in ways(records, course).items():
        rows = [k for k, pose in enumerate(poses) if pose is not None]
        if rows:
            way = Trajectory(flight.times_s[rows], np.stack([np.asarray(poses[k]) for k in rows]))
            save_trajectory(way, folder / f"{name}.tum")
