"""Fly-throughs (paper, Section 4.2, with a moving camera): each frame rendered, detected, identified and scored.

Frames are independent of each other, so that an interrupted flight resumes where it stopped; what needs their order
(tracks, poses, motion) is computed from their records (`flight_tracking`).
"""

from dataclasses import dataclass, replace
from time import perf_counter
from typing import get_args

import numpy as np
from numpy.typing import NDArray
from peaksim.camera.frame import Frame
from peaksim.camera.presets import sensor_named
from peaksim.camera.sensor import apply_sensor
from peaksim.scene.file import Setup, load_scene
from peaksim.scene.ride import Ride
from peaksim.scene.ride_file import load_ride, shortened
from peaksim.scene.scene import Scene

from peakmark.experiments.drawing import Drawing
from peakmark.experiments.floor.view import FloorView, score_view
from peakmark.experiments.option import check_choice, check_range
from peakmark.identification.api import STRONGEST, Narrower
from peakmark.identification.stretch import LARGEST, SMALLEST, Stretch, floor_stretch
from peakmark.localise.locate import FloorMap


@dataclass(frozen=True)
class FlightConfig(Drawing):
    """What to fly through and how to find markers."""

    trajectory: str = "stroll"
    """Ride (TOML) or its shipped name, or a TUM, EuRoC or KITTI file."""
    scene: str | None = None
    """Scene file or name; None takes the one that the ride names."""
    texture: str | None = None
    """Variant of the texture named "floor"; None takes the first."""
    stretch: float | None = None
    """Vertical stretch before detection; None gives each row the one that the camera's pitch implies, where that is
    known, else 2."""
    rule: Narrower = "joint"
    """How key points become markers."""
    frames: int | None = None
    """Only so many frames from the start; None takes all."""
    map: str | None = None
    """Scene file or name whose markers are the map; None takes the scene that is flown through."""

    def __post_init__(self) -> None:
        super().__post_init__()
        check_range("frames", self.frames, 1, 1_000_000)
        check_range("stretch", self.stretch, SMALLEST, LARGEST)
        check_choice("rule", self.rule, get_args(Narrower))


@dataclass(frozen=True)
class Flight:
    """A loaded flight."""

    config: FlightConfig
    setup: Setup
    """The scene and its own camera."""
    ride: Ride
    """Camera, trajectory, sensor and light."""
    times_s: NDArray[np.float64]
    """(n,) of the frames."""
    stretch: Stretch
    """What `config.stretch` comes to."""
    floor_map: FloorMap | None
    """Of the markers of the scene that `config.map` names, see `map_of`."""
    marker_names: list[str]
    """Names of the markers of the map, in its order."""


def open_flight(config: FlightConfig) -> Flight:
    """Load scene and ride; an `InputError` names a faulty file, a missing texture, a camera that leaves the room."""
    setup, ride = load_ride(config.trajectory, config.scene, config.texture, config.seed)
    if config.sensor is not None:
        ride = replace(ride, sensor=sensor_named(config.sensor))
    if config.frames is not None:
        ride = shortened(ride, config.frames)
    mapped = setup.scene if config.map is None else load_scene(config.map).scene
    names = [mark.name for quad in mapped.quads for mark in quad.marks]
    times_s = ride.trajectory.frame_times_s(ride.frames_per_second)
    return Flight(config, setup, ride, times_s, stretch_of(config, ride), map_of(mapped), names)


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


def render_view(flight: Flight, index: int) -> FloorView:
    """Render, detect, identify and score one frame; it depends on nothing but the configuration and the index."""
    start = perf_counter()
    frame = render_frame(flight, index)
    return score_flight_view(index, frame, perf_counter() - start, flight.stretch, flight.config.rule)


def score_flight_view(index: int, frame: Frame, render_s: float, stretch: Stretch, rule: Narrower) -> FloorView:
    """Score a frame that took so long to render, from its strongest features unless the paper's rule wants all."""
    return score_view(index, frame, render_s, stretch, rule, None if rule == "paper" else STRONGEST)


def render_frame(flight: Flight, index: int) -> Frame:
    """Return one frame after the sensor; its truth is that of mid-exposure."""
    time_s = float(flight.times_s[index])
    config, ride, seeds = flight.config, flight.ride, (flight.config.seed, index)
    frame = config.frame(flight.setup.scene, ride.camera, ride.trajectory, time_s, seeds)
    return apply_sensor(frame, ride.sensor_at(time_s), np.random.default_rng(seeds))
