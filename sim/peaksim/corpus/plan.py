"""What each frame of a corpus is: pure functions of the specification, the seed and the frame's index.

A *sequence* is a run of `sequence_frames` frames that share a scene, with its textures, markers and clutter, and a
camera and a kind of view. AnyView, light and sensor are drawn for every frame.
"""

from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from peaksim.camera.camera import Camera
from peaksim.camera.presets import sensor_named
from peaksim.camera.sensor import Sensor
from peaksim.corpus import layout
from peaksim.corpus.cameras import NamedCamera, drawn_cameras
from peaksim.corpus.draws import Draws, frame_draws, sequence_draws
from peaksim.corpus.lamps import lamps_in
from peaksim.corpus.photographs import photographs
from peaksim.corpus.spec import CorpusSpec
from peaksim.corpus.spec_scene import LightSpread
from peaksim.corpus.spec_sensor import SensorSpread, sensor_value
from peaksim.corpus.spec_views import AnyView, FlightView
from peaksim.corpus.spec_warped import WarpedSpread
from peaksim.corpus.vary import vary_scene
from peaksim.corpus.views import is_free, markers_ahead, view_pose
from peaksim.corpus.warped import POSE, warped_scene
from peaksim.errors import InputError, SceneError
from peaksim.geometry.pose import Pose
from peaksim.geometry.trajectory import Trajectory
from peaksim.geometry.trajectory_file import load_trajectory
from peaksim.scene.build_camera import build_camera
from peaksim.scene.file import Setup, build_setup, find_scene_beside, read_table
from peaksim.scene.scene import Light, Scene
from peaksim.scene.schema import RoomTable, SceneTable
from peaksim.shipped import path_inside
from peaksim.traced import SAMPLES

_SEQUENCES_LOOKED_AT = 1000
MOST_ATTEMPTS = 1000
"""Views drawn for one frame before the specification is called contradictory. `check_spec` allows a tenth, so that a
specification that passed it fails in no frame of a large corpus."""


@dataclass(frozen=True)
class Sequence:
    """What the frames of a sequence share, ready to render."""

    number: int
    """From 0."""
    scene_file: str
    """As the specification names it."""
    setup: Setup
    """The scene as varied for this sequence, with the file's own camera, trajectory and sensor."""
    room: RoomTable | None
    """Room that the camera may not leave."""
    camera: NamedCamera
    """Camera of all its frames."""
    view: AnyView | WarpedSpread
    """How poses are drawn."""
    trajectory: Trajectory
    """Trajectory that flights follow."""


@dataclass(frozen=True)
class FramePlan:
    """Everything that decides one frame's bytes."""

    index: int
    """From 0."""
    sequence: Sequence
    """Sequence that it belongs to."""
    scene: Scene
    """With this frame's lights."""
    world_from_camera: Pose
    """(4, 4)."""
    time_s: float
    """On the sequence's trajectory; 0 for still views."""
    sensor: Sensor
    """This frame's settings."""
    seed: int
    """Seed of the corpus."""
    samples: int = SAMPLES
    """Paths a pixel, for the traced renderer."""
    bake: bool = True
    """Whether the others show lamps and skies by baked light."""
    photograph: Path | None = None
    """Image file behind the scene; None for none."""

    @property
    def camera(self) -> Camera:
        """Camera of the sequence."""
        return self.sequence.camera.camera

    def noise(self) -> np.random.Generator:
        """Return the source of this frame's sensor noise."""
        return np.random.default_rng((self.seed, self.index))


def plan_frame(spec: CorpusSpec, folder: Path, index: int, attempts: int = MOST_ATTEMPTS) -> FramePlan:
    """Return a frame's plan; `folder` is where the specification's files are.

    Raises
    ------
    SceneError
        One line that names the frame, if no view fulfils the specification.
    """
    if spec.warped is not None:
        return _warped_frame(spec, spec.warped, folder, index)
    sequence = open_sequence(spec, folder, index // spec.sequence_frames)
    try:
        pose, time_s, draws = _view(spec, sequence, index, attempts)
    except SceneError as error:
        raise SceneError(f"frame {index}: {error}") from error
    return FramePlan(
        index=index,
        sequence=sequence,
        scene=_lit(sequence, spec, draws),
        world_from_camera=pose,
        time_s=time_s,
        sensor=_sensor(sequence.setup.sensor, spec, draws, sequence.number),
        seed=spec.seed,
        samples=SAMPLES if spec.samples is None else spec.samples,
        bake=spec.bake is not False,
    )


def _warped_frame(spec: CorpusSpec, spread: WarpedSpread, folder: Path, index: int) -> FramePlan:
    """Return the plan of sheets in a photograph, with a camera of its sequence's."""
    number = index // spec.sequence_frames
    draws, camera = frame_draws(spec.seed, index), _camera(spec, folder, sequence_draws(spec.seed, number), 0)
    files = photographs(folder, spread.photographs)
    name = draws.pick("warped.photograph", tuple(files))
    scene = warped_scene(spread, spec.bends, spec.prints, camera.camera, draws)
    trajectory = Trajectory(np.zeros(1), POSE[None])
    sequence = Sequence(
        number, name, Setup(scene, camera.camera, trajectory, Sensor()), None, camera, spread, trajectory
    )
    return FramePlan(
        index=index,
        sequence=sequence,
        scene=scene,
        world_from_camera=POSE,
        time_s=0.0,
        sensor=_sensor(Sensor(), spec, draws, number),
        seed=spec.seed,
        photograph=files[name],
    )


def _view(spec: CorpusSpec, sequence: Sequence, index: int, attempts: int) -> tuple[Pose, float, Draws]:
    """Draw views until one is in the room and shows as many markers as the view needs."""
    setup, view, camera = sequence.setup, sequence.view, sequence.camera.camera
    assert not isinstance(view, WarpedSpread)
    position = (index % spec.sequence_frames) / max(1, spec.sequence_frames - 1)
    room = None if sequence.room is None else (np.array(sequence.room.min_m), np.array(sequence.room.max_m))
    furniture = () if isinstance(view, FlightView) else setup.scene.meshes  # flights may pass anywhere
    for attempt in range(attempts):
        draws = frame_draws(spec.seed, index, attempt)
        try:
            pose, time_s = view_pose(view, setup.scene, camera, sequence.trajectory, position, draws)
        except SceneError:
            if attempt == attempts - 1:
                raise
            continue
        if is_free(furniture, room, pose) and markers_ahead(setup.scene, camera, pose) >= view.min_markers:
            return pose, time_s, draws
    raise SceneError(
        f"views: expected a view of kind {view.kind!r} inside the room of {sequence.scene_file!r}, not in "
        f"furniture, with {view.min_markers} markers, got none in {attempts} draws"
    )


def _lit(sequence: Sequence, spec: CorpusSpec, draws: Draws) -> Scene:
    scene = sequence.setup.scene
    if spec.light is None:
        return scene
    level = _level(spec.light.per, spec, draws, sequence.number)
    lamps = () if sequence.room is None else tuple(lamps_in(sequence.room, spec.light, level))
    return replace(scene, lights=(*_lights(spec.light, level), *lamps))


def _level(per: str, spec: CorpusSpec, draws: Draws, sequence: int) -> Draws:
    return draws if per == "frame" else sequence_draws(spec.seed, sequence)


def _lights(spread: LightSpread, draws: Draws) -> tuple[Light, ...]:
    elevation, azimuth = (
        np.radians(draws.value(f"light.{name}", getattr(spread, name))) for name in ("elevation_deg", "azimuth_deg")
    )
    down = (-np.cos(elevation) * np.cos(azimuth), -np.cos(elevation) * np.sin(azimuth), -np.sin(elevation))
    ambient = Light("ambient", draws.value("light.ambient", spread.ambient))
    intensity = draws.value("light.directional", spread.directional)
    if intensity == 0:
        return (ambient,)
    x, y, z = (float(part) for part in down)
    return ambient, Light("directional", intensity, direction=(x, y, z), casts_shadows=spread.shadows)


def _sensor(sensor: Sensor, spec: CorpusSpec, draws: Draws, sequence: int) -> Sensor:
    spread: SensorSpread = spec.sensor
    level = _level(spread.per, spec, draws, sequence)
    drawn = {name: sensor_value(name, level.value(f"sensor.{name}", values)) for name, values in spread.spreads.items()}
    words = {name: level.pick(f"sensor.{name}", words) for name, words in spread.choices.items()}
    base = sensor if spread.presets is None else sensor_named(level.pick("sensor.presets", spread.presets))
    return replace(base, **drawn, **words)  # type: ignore[arg-type]


# --- sequences ------------------------------------------------------------------------------------------------


@lru_cache(maxsize=2)
def open_sequence(spec: CorpusSpec, folder: Path, number: int) -> Sequence:
    """Draw and build a sequence; the last two are cached, as neighbouring frames share them.

    Raises
    ------
    SceneError
        One line that names the sequence's scene and the field.
    """
    draws = sequence_draws(spec.seed, number)
    choice = _scene_number(spec, draws)
    file = spec.scenes[choice].file
    table, beside = read_scene(file, folder)
    try:
        setup = build_setup(vary_scene(table, spec, draws), beside)
    except InputError as error:
        raise SceneError(f"{file}: {error}") from error
    view = spec.views[draws.index("view", tuple(view.weight for view in spec.views))]
    camera = _camera(spec, folder, draws, choice)
    return Sequence(number, file, setup, table.room, camera, view, _trajectory(view, setup, folder))


def first_frames(spec: CorpusSpec) -> list[int]:
    """Return the first frame that shows each scene that comes among the first sequences; frame 0 if there are none."""
    if not spec.scenes:
        return [0]
    numbers = range(min(spec.sequences, _SEQUENCES_LOOKED_AT))
    scenes = [_scene_number(spec, sequence_draws(spec.seed, number)) for number in numbers]
    return [scenes.index(scene) * spec.sequence_frames for scene in sorted(set(scenes))]


def _scene_number(spec: CorpusSpec, draws: Draws) -> int:
    return draws.index("scene", tuple(scene.weight for scene in spec.scenes))


def read_scene(file: str, folder: Path) -> tuple[SceneTable, Path]:
    """Return the tables of a scene: a file beside the specification, or the name of one that ships."""
    return read_table(find_scene_beside(folder, file, "scenes.file"))


def corpus_cameras(spec: CorpusSpec, folder: Path) -> tuple[NamedCamera, ...]:
    """Return the cameras of a corpus: those of `[[cameras]]`, or else each scene's own."""
    if spec.cameras:
        return drawn_cameras(spec)
    tables = (read_scene(choice.file, folder)[0] for choice in spec.scenes)
    names = layout.camera_names(spec)
    return tuple(NamedCamera(name, build_camera(table.camera), 1.0) for name, table in zip(names, tables, strict=True))


def _camera(spec: CorpusSpec, folder: Path, draws: Draws, scene: int) -> NamedCamera:
    cameras = corpus_cameras(spec, folder)
    return cameras[draws.index("camera", tuple(c.weight for c in cameras)) if spec.cameras else scene]


def _trajectory(view: AnyView, setup: Setup, folder: Path) -> Trajectory:
    if isinstance(view, FlightView) and view.file is not None:
        return load_trajectory(path_inside(folder, view.file, "views.file"))
    return setup.trajectory
