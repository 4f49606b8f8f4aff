"""Fly-throughs (paper, Section 4.2, with a moving camera): each frame rendered, detected, identified and scored.

Frames are independent of each other and come out as plain records, so that an interrupted flight goes on where it
stopped; what needs their order (tracks, poses, motion) is computed from the records (`flight_course`).
"""

from dataclasses import asdict, dataclass, replace
from time import perf_counter
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray
from peaksim.camera.frame import Frame, MarkerTruth
from peaksim.camera.sensor import take
from peaksim.rendering import Renderer, render
from peaksim.scene.file import Setup, load_scene
from peaksim.scene.ride import Ride
from peaksim.scene.ride_file import load_ride, shortened
from peaksim.scene.scene import Scene

from peakmark.errors import InputError
from peakmark.identification import api as identification
from peakmark.identification.api import Rule
from peakmark.identification.detection import Detection, Identification
from peakmark.identification.stretch import LARGEST, SMALLEST, Stretch, floor_stretch
from peakmark.keypoints.image import as_gray
from peakmark.localise.locate import FloorMap
from peakmark.score.markers import Score, score_frame


@dataclass(frozen=True)
class FlightConfig:
    """What to fly through and how to look for markers."""

    trajectory: str = "stroll"
    """Ride (TOML) or its shipped name, or a TUM, EuRoC or KITTI file."""
    scene: str | None = None
    """Scene file or name; None takes the one that the ride names."""
    texture: str | None = None
    """Variant of the texture named "floor"; None takes the first."""
    renderer: Renderer = "auto"
    """"gl", "exact", "traced" or "auto": exact without furniture, which needs GL."""
    seed: int = 0
    """Of bumps and noise."""
    stretch: float | None = None
    """Vertical stretch before detection; None gives each row the one that the camera's pitch implies, where that is
    known, else 2."""
    rule: Rule = "joint"
    """How key points become markers."""
    frames: int | None = None
    """Only so many frames from the start; None takes all."""
    map: str | None = None
    """Scene file or name whose markers are the map; None takes the scene that is flown through."""
    samples: int = 64
    """Paths a pixel of the traced renderer."""

    def __post_init__(self) -> None:
        for name, value, fits, expected in (
            ("seed", self.seed, self.seed >= 0, "0 or more"),
            ("frames", self.frames, self.frames is None or 1 <= self.frames <= 1_000_000, "1…1000000"),
            ("stretch", self.stretch, self.stretch is None or SMALLEST <= self.stretch <= LARGEST, "0.25…8"),
            ("renderer", self.renderer, self.renderer in get_args(Renderer), "auto, gl, exact or traced"),
            ("samples", self.samples, self.samples >= 1, "1 or more"),
            ("rule", self.rule, self.rule in get_args(Rule), "joint or paper"),
        ):
            if not fits:
                raise InputError(f"--{name}: expected {expected}, got {value}")


@dataclass(frozen=True)
class Flight:
    """A loaded flight."""

    config: FlightConfig
    setup: Setup
    ride: Ride
    times_s: NDArray[np.float64]
    """(n,) of the frames."""
    stretch: Stretch
    """What `config.stretch` comes to."""
    floor_map: FloorMap | None
    """Of the markers of the scene that `config.map` names, see `map_of`."""
    marker_names: list[str]
    """Names of the markers of the map, in its order."""


@dataclass(frozen=True)
class Shot:
    """One frame and what was found in it."""

    frame: Frame
    """After the sensor."""
    found: Identification
    score: Score
    record: dict[str, Any]
    """The plain values that the rest of the flight needs."""


def open_flight(config: FlightConfig) -> Flight:
    """Load scene and ride.

    Raises
    ------
    InputError
        One line for a faulty file, a camera that leaves the room, or a texture that is not there.
    """
    setup, ride = load_ride(config.trajectory, config.scene, config.texture, config.seed)
    if config.frames is not None:
        ride = shortened(ride, config.frames)
    charted = setup.scene if config.map is None else load_scene(config.map).scene
    names = [mark.name for quad in charted.quads for mark in quad.marks]
    times_s = ride.trajectory.frame_times_s(ride.frames_per_second)
    return Flight(config, setup, ride, times_s, stretch_of(config, ride), map_of(charted), names)


def stretch_of(config: FlightConfig, ride: Ride) -> Stretch:
    """Return the stretch to use: the given one, that of the camera's pitch, or the paper's 2."""
    if config.stretch is not None:
        return config.stretch
    return 2.0 if ride.mount is None else floor_stretch(ride.camera, ride.mount.pitch_deg)


def map_of(scene: Scene) -> FloorMap | None:
    """Return a scene's markers as a map, if they all lie on one level floor and are of one size; else None."""
    poses = [quad.world_from_quad for quad in scene.quads for _ in quad.marks]
    sides = {mark.side_m for quad in scene.quads for mark in quad.marks}
    level = {round(float(pose[2, 3]), 6) for pose in poses}
    if len(level) != 1 or len(sides) != 1 or any(pose[2, 2] < 0.999 for pose in poses):
        return None
    return FloorMap(np.array([pose[:3, 3] for pose in poses]), sides.pop())


def shoot(flight: Flight, index: int) -> Shot:
    """Render, detect, identify and score one frame; it depends on nothing but the configuration and the index."""
    start = perf_counter()
    frame = photograph(flight, index)
    return judge(frame, flight.stretch, flight.config.rule, index, perf_counter() - start)


def judge(frame: Frame, stretch: Stretch, rule: Rule, index: int, render_s: float) -> Shot:
    """Detect, identify and score the markers of a frame that took so long to render."""
    start = perf_counter()
    gray = as_gray(frame.image)
    strongest = None if rule == "paper" else identification.STRONGEST
    features = identification.stretched_features(gray, stretch, strongest=strongest)
    detected = perf_counter()
    found = identification.examine(gray, features, "dark", rule, stretch)
    identified = perf_counter()
    score = score_frame(frame.truth, found.detections, found.features)
    seconds = {
        "render": render_s,
        "detect": detected - start,
        "identify": identified - detected,
        "score": perf_counter() - identified,
    }
    record = {
        "frame": index,
        "time_on_path_s": frame.time_s,
        "renderer": [frame.renderer, frame.gl_renderer],
        "world_from_camera": frame.world_from_camera.tolist(),
        "features": len(found.features),
        "score": score.summary(),
        "time_s": seconds,
        "truth": [_truth_record(truth) for truth in frame.truth if truth.visible_fraction > 0],
        "detections": [_detection_record(d, found, score) for d in found.detections],
    }
    return Shot(frame, found, score, record)


def photograph(flight: Flight, index: int) -> Frame:
    """Return one frame after the sensor; its truth is that of mid-exposure."""
    time_s, scene = float(flight.times_s[index]), flight.setup.scene
    renderer = quicker(flight.config.renderer, scene)
    config, ride = flight.config, flight.ride
    frame = render(scene, ride.camera, ride.trajectory, renderer, time_s, config.samples, (config.seed, index))
    noise = np.random.default_rng((flight.config.seed, index))
    return replace(frame, image=take(frame.linear, flight.ride.sensor_at(time_s), noise))


def quicker(renderer: Renderer, scene: Scene) -> Renderer:
    """Return the exact renderer for "auto" where there is no furniture: it is faster there than OpenGL on a CPU."""
    return "exact" if renderer == "auto" and not scene.meshes else renderer


def _truth_record(truth: MarkerTruth) -> dict[str, Any]:
    record = asdict(truth)
    del record["kind"]
    return {name: _plain(value) for name, value in record.items()}


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _plain(one) for name, one in value.items()}
    return value.tolist() if isinstance(value, np.ndarray) else value


def _detection_record(detection: Detection, found: Identification, score: Score) -> dict[str, Any]:
    """Return a detection with the feature that it comes from, and the name of the marker that it truly is."""
    row = detection.rank - 1
    names = {index: name for name, index in score.matches.items()}
    return {
        "xy": detection.xy.tolist(),
        "side_px": detection.size,
        "affinity": None if detection.affinity is None else detection.affinity.tolist(),
        "explained": detection.explained,
        "response": detection.response,
        "signature_distance": detection.signature_distance,
        "rank": detection.rank,
        "feature_xy": found.features.xy[row].tolist(),
        "scale_px": float(found.features.scale[row]),
        "rounded_scale_px": float(found.features.size[row]),
        "truth": names.get(detection.id),
    }
