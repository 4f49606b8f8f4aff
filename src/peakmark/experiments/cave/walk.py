"""The SIFT/SURF CAVE (paper, Section 4.2, Figures 13–15): 3-bit arrays on the walls of a room, read and scored."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from time import perf_counter
from typing import get_args

import numpy as np
from peaksim.camera.frame import Frame
from peaksim.camera.sensor import apply_sensor
from peaksim.scene.file import Setup, load_scene
from peaksim.scene.scene import Scene

from peakmark.arrays.decode import MarkerArray, decode_arrays
from peakmark.errors import InputError
from peakmark.experiments.cave.finding import CaveRule, detect, find
from peakmark.experiments.option import check_choice
from peakmark.experiments.scene_images import SceneImagesConfig
from peakmark.identification.detection import Identification
from peakmark.keypoints.image import as_gray
from peakmark.localise.from_arrays import Place, pose_from_arrays
from peakmark.localise.pose import PoseEstimate
from peakmark.markers.patterns import IN_PLACE_OF_SURF, Made
from peakmark.plain import INLINED
from peakmark.score.arrays import ArrayScore, PrintedArray, printed_arrays, score_arrays
from peakmark.score.markers import Score, score_frame
from peakmark.score.poses import pose_error
from peakmark.score.wanted import READABLE


@dataclass(frozen=True)
class CaveConfig(SceneImagesConfig):
    """What to render."""

    scene: str = "cave"
    rule: CaveRule = field(default="robust", kw_only=True)
    """"robust" weighs each feature and reads arrays at any roll; "paper" is the paper's: response and
    version-independent signature, then upright clusters."""
    marker: Made = field(default="surf", kw_only=True)
    """Markers on the walls, and the detector that finds them."""

    def __post_init__(self) -> None:
        super().__post_init__()
        check_choice("rule", self.rule, get_args(CaveRule))
        check_choice("marker", self.marker, get_args(Made))


@dataclass(frozen=True)
class Reading:
    """What was found in one image; nothing here knows the truth."""

    found: Identification
    """Features, their distances from the version-independent signature, and markers."""
    arrays: tuple[MarkerArray, ...]
    """By the robust decoder."""
    by_paper: tuple[MarkerArray, ...]
    """By the paper's rule, which takes the arrays for upright."""
    pose: PoseEstimate | None
    """The camera's, from all arrays whose code is on the map; None without any, and by the paper's rule, which does not
    refine markers."""
    time_s: dict[str, float]
    """Seconds for "detect", "identify", "decode" and "localise"."""


@dataclass(frozen=True)
class Counts:
    """Figures of a frame that add up over frames."""

    markers_in_view: int
    markers_found: int
    """Markers that must be found, and those that were."""
    false_detections: int
    """Detections at no visible marker."""
    polarity_errors: int
    polarity_errors_by_signature: int
    """Found markers with the wrong sign of the Laplacian, and with a signature nearer to that of the other polarity."""
    arrays_in_view: int
    arrays_decoded: int
    """Arrays that must be read, and those that were."""
    wrong_codes: int
    """Codes that were named where no array with that code lies."""
    unsure: int
    """Readings without a code."""
    arrays_decoded_by_paper: int
    wrong_codes_by_paper: int
    """The same by the paper's rule."""


COUNTS = tuple(each.name for each in fields(Counts))


def total(counts: Sequence[Counts]) -> Counts:
    """Return the sums of all frames."""
    return Counts(**{name: sum(getattr(one, name) for one in counts) for name in COUNTS})


@dataclass(frozen=True)
class CaveFrame:
    """The plain figures of one frame; a row of frames.csv, the counts inlined."""

    frame: int
    time_on_path_s: float
    """Number from 0, and when it was taken."""
    features: int
    counts: Counts = field(metadata=INLINED)
    """Number of key points, and what adds up over frames."""
    codes: tuple[int, ...]
    """That were read, rightly or wrongly."""
    missed: tuple[str, ...]
    """Names of the arrays and markers in view that were not found."""
    pose_mm: float | None
    pose_deg: float | None
    """Distance and angle of the camera's pose from the true one; None without a pose."""
    pose_is_certain: bool | None
    """Whether no other pose explains the image nearly as well."""
    rank_of_last_marker: int | None
    response_drop: float | None
    """See `Score`."""
    time_s: dict[str, float]
    """Seconds by stage, "render" among them."""


@dataclass(frozen=True)
class CaveView:
    """One frame, what was found in it, and how well."""

    index: int
    """Frame number from 0."""
    frame: Frame
    """After the sensor."""
    reading: Reading
    markers: Score
    """Markers, and the responses of all features, against truth."""
    arrays: ArrayScore
    paper: ArrayScore
    """Arrays against truth, read by the robust decoder and by the paper's rule."""
    pose_error: tuple[float, float] | None
    """Of the camera, mm and degrees; None without a pose."""
    render_s: float
    """Seconds for the image, with truth and sensor."""
    made_for: Made
    """The detector whose markers hang on the walls."""

    def record(self) -> CaveFrame:
        """Return the plain figures of this frame."""
        return CaveFrame(
            frame=self.index,
            time_on_path_s=self.frame.time_s,
            features=len(self.reading.found.features),
            counts=self.counts(),
            codes=tuple(array.code for array in self.reading.arrays if array.code is not None),
            missed=(*self.arrays.missed, *self.markers.missed),
            pose_mm=None if self.pose_error is None else self.pose_error[0],
            pose_deg=None if self.pose_error is None else self.pose_error[1],
            pose_is_certain=None if self.reading.pose is None else self.reading.pose.is_certain,
            rank_of_last_marker=self.markers.rank_of_last_marker,
            response_drop=self.markers.response_drop,
            time_s={"render": self.render_s, **self.reading.time_s},
        )

    def counts(self) -> Counts:
        """Return what can be added up over frames."""
        return Counts(
            markers_in_view=self.markers.markers_in_view,
            markers_found=self.markers.markers_found,
            false_detections=self.markers.false_detections,
            polarity_errors=self.markers.polarity_errors,
            polarity_errors_by_signature=self.markers.signature_errors,
            arrays_in_view=len(self.arrays.in_view),
            arrays_decoded=len(self.arrays.decoded),
            wrong_codes=self.arrays.wrong,
            unsure=self.arrays.unsure,
            arrays_decoded_by_paper=len(self.paper.decoded),
            wrong_codes_by_paper=self.paper.wrong,
        )


def array_map(printed: Sequence[PrintedArray]) -> dict[int, Place]:
    """Return code → where its array hangs; a code that hangs twice is left out."""
    codes = [array.code for array in printed]
    return {array.code: array.place for array in printed if codes.count(array.code) == 1}


def read_frame(
    frame: Frame, places: Mapping[int, Place], rule: CaveRule = "robust", made_for: Made = "surf"
) -> Reading:
    """Find, decode and localise in one frame; only its image and camera are used."""
    gray, laps = as_gray(frame.image), [perf_counter()]
    features = detect(gray, rule, made_for)
    laps.append(perf_counter())
    found = find(gray, features, rule, made_for)
    laps.append(perf_counter())
    by_paper = decode_arrays(found.detections, rule="paper")
    arrays = decode_arrays(found.detections, image=gray) if rule == "robust" else by_paper
    laps.append(perf_counter())
    pose = pose_from_arrays(frame.camera, arrays, places) if rule == "robust" else None
    laps.append(perf_counter())
    times = dict(zip(("detect", "identify", "decode", "localise"), np.diff(laps).tolist(), strict=True))
    return Reading(found, arrays, by_paper, pose, times)


def score_view(
    index: int, frame: Frame, scene: Scene, render_s: float = 0.0, rule: CaveRule = "robust", made_for: Made = "surf"
) -> CaveView:
    """Read a frame and score it against truth."""
    printed = printed_arrays(scene)
    reading = read_frame(frame, array_map(printed), rule, made_for)
    camera, pose = frame.camera, frame.world_from_camera
    return CaveView(
        index=index,
        frame=frame,
        reading=reading,
        markers=score_frame(frame.truth, reading.found.detections, reading.found.features, READABLE),
        arrays=score_arrays(printed, frame.truth, reading.arrays, camera, pose),
        paper=score_arrays(printed, frame.truth, reading.by_paper, camera, pose),
        pose_error=None if reading.pose is None else pose_error(reading.pose.fit.world_from_camera, pose),
        render_s=render_s,
        made_for=made_for,
    )


def render_view(setup: Setup, config: CaveConfig, index: int, time_s: float) -> CaveView:
    """Render, read and score one frame."""
    start = perf_counter()
    seeds, path = (config.seed, index), setup.trajectory
    frame = config.frame(setup.scene, setup.camera, path, time_s, seeds)
    frame = apply_sensor(frame, setup.sensor, np.random.default_rng(seeds))
    return score_view(index, frame, setup.scene, perf_counter() - start, config.rule, config.marker)


def render_walk(setup: Setup, config: CaveConfig) -> Iterator[CaveView]:
    """Yield the views of the trajectory one by one; nothing is kept between them."""
    times = setup.trajectory.times_s
    for index, time_s in enumerate(np.linspace(times[0], times[-1], config.frames)):
        yield render_view(setup, config, index, float(time_s))


def open_cave(config: CaveConfig) -> Setup:
    """Load the configuration's scene; one without an array is an `InputError`."""
    setup = load_scene(config.scene, kinds=IN_PLACE_OF_SURF[config.marker]).seen_by(config.sensor)
    if not printed_arrays(setup.scene):
        raise InputError(f"--scene {config.scene}: expected posters with 3-bit arrays, found none")
    return setup
