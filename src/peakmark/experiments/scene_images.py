"""A scene's images with their truth, as files: what `peakmark render` writes."""

import json
import math
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from peaksim.camera.frame import Frame
from peaksim.camera.sensor import apply_sensor
from peaksim.geometry.trajectory import Trajectory
from peaksim.geometry.trajectory_file import save_trajectory
from peaksim.scene.file import Setup, load_scene
from PIL import Image

from peakmark.experiments.drawing import Drawing
from peakmark.experiments.option import check_range
from peakmark.plain import to_plain
from peakmark.report.results import result_folder, write_json

CAMERA, POSES, TRUTH = "camera.yaml", "poses.tum", "truth.jsonl"
"""Files beside the images: OpenCV's calibration, the true poses, and a line of markers an image."""


@dataclass(frozen=True)
class SceneImagesConfig(Drawing):
    """What is rendered."""

    scene: str
    """Scene file, or the name of one that ships with the package."""
    frames: int = 1
    """Frames in even steps of the trajectory's time; 1 takes its first pose."""

    def __post_init__(self) -> None:
        super().__post_init__()
        check_range("frames", self.frames, 1, 100_000)


def write_scene_images(
    config: SceneImagesConfig, out: Path, on_frame: Callable[[], None] = lambda: None
) -> list[dict[str, Any]]:
    """Render a scene's frames into a folder with calibration, poses and truth; return a plain record of each.

    Raises
    ------
    InputError
        If the scene or a setting cannot be used, or the folder not be written.
    """
    setup = load_scene(config.scene).seen_by(config.sensor)
    records = []
    with result_folder(out) as folder:
        with (folder / TRUTH).open("w", encoding="utf-8") as truth:
            for index, frame in enumerate(_frames(setup, config)):
                name = f"{index:06d}.png"
                Image.fromarray(frame.image).save(folder / name)
                records.append(_record(name, frame))
                truth.write(json.dumps(records[-1], allow_nan=False) + "\n")
                on_frame()
        setup.camera.save(folder / CAMERA)
        poses = np.array([record["world_from_camera"] for record in records])
        save_trajectory(Trajectory(np.array([record["time_s"] for record in records]), poses), folder / POSES)
        write_json(folder / "result.json", {"settings": asdict(config), "frames": len(records), "truth": TRUTH})
    return records


def _frames(setup: Setup, config: SceneImagesConfig) -> Iterator[Frame]:
    times = setup.trajectory.times_s
    for index, time_s in enumerate(np.linspace(times[0], times[-1], config.frames)):
        moving = setup.trajectory if setup.camera.exposure_s or setup.camera.row_time_s else None
        pose = setup.trajectory.at(float(time_s)) if moving is None else moving
        seeds = (config.seed, index)
        frame = config.frame(setup.scene, setup.camera, pose, float(time_s), seeds)
        yield apply_sensor(frame, setup.sensor, np.random.default_rng(seeds))


def _record(name: str, frame: Frame) -> dict[str, Any]:
    return {
        "image": name,
        "time_s": frame.time_s,
        "renderer": frame.renderer,
        "world_from_camera": frame.world_from_camera.tolist(),
        "markers": [_without_nan(to_plain(marker)) for marker in frame.truth],
    }


def _without_nan(value: Any) -> Any:
    """Return plain values with None for what is not defined, as behind the camera."""
    if isinstance(value, dict):
        return {name: _without_nan(part) for name, part in value.items()}
    if isinstance(value, list):
        return [_without_nan(part) for part in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
