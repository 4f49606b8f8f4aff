"""One frame of a corpus as bytes: the encoded image, and the record of its truth."""

import json
from dataclasses import asdict, dataclass, replace
from hashlib import sha256
from io import BytesIO
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from peaksim.area.faces import panel_counts
from peaksim.area.rays import first_faces, solids_of
from peaksim.camera.camera import Camera
from peaksim.camera.frame import Frame, MarkerTruth
from peaksim.camera.sensor import apply_sensor
from peaksim.corpus.backdrop import into_photograph
from peaksim.corpus.plan import FramePlan
from peaksim.corpus.spec import PictureTable
from peaksim.errors import InputError, RendererError
from peaksim.geometry.pose import Pose, invert, transform
from peaksim.image_file import read_image
from peaksim.rendering import Renderer, render
from peaksim.scene.lamps import plain_values
from peaksim.scene.scene import Scene, rectangle_m
from peaksim.truth.outline import seen_outline

KEYPOINTS = ("center", "top_left", "top_right", "bottom_right", "bottom_left")
"""The points of a marker, in the order of every table."""

UNSEEN, COVERED, SEEN = 0, 1, 2
_SAME_POINT = 2e-3
"""Share of a distance within which a ray meets the point that it was aimed at."""
"""Visibility of a point as COCO counts it: outside the image, hidden behind something, seen."""

Record = dict[str, Any]


@dataclass(frozen=True)
class Sample:
    """A finished frame."""

    image: bytes
    """PNG or JPEG."""
    record: bytes
    """One line of JSON; CORPUS.md lists its fields."""


def render_frame(plan: FramePlan, renderer: Renderer) -> Frame:
    """Return a plan's image, after the sensor, and its truth."""
    if plan.photograph is not None:
        return _render_over(plan, plan.photograph, renderer)
    seeds = plan.seed, plan.index
    pose, time_s = plan.world_from_camera, plan.time_s
    frame = render(plan.scene, plan.camera, pose, renderer, time_s, samples=plan.samples, seed=seeds, bake=plan.bake)
    return apply_sensor(frame, plan.sensor, plan.noise())


def _render_over(plan: FramePlan, photograph: Path, renderer: Renderer) -> Frame:
    """Return a plan's sheets in its photograph; the sensor takes what the photograph's camera has coded."""
    over_black, over_white = (
        render(replace(plan.scene, background=level), plan.camera, plan.world_from_camera, renderer, plan.time_s)
        for level in (0.0, 255.0)
    )
    noise = plan.noise()
    return apply_sensor(into_photograph(over_black, over_white, photograph, noise), plan.sensor, noise)


def make_sample(plan: FramePlan, renderer: Renderer, settings: PictureTable) -> Sample:
    """Render a plan and return its bytes."""
    frame = render_frame(plan, renderer)
    image = encode_image(frame.image, settings)
    return Sample(image, to_line(record_of(plan, frame, image)))


def encode_image(image: NDArray[Any], settings: PictureTable) -> bytes:
    """Return a grey or RGB image as the bytes of a file."""
    # noise hardly compresses: run lengths after a good filter give the same size in a quarter of the time
    quick = [
        cv2.IMWRITE_PNG_COMPRESSION,
        1,
        cv2.IMWRITE_PNG_STRATEGY,
        cv2.IMWRITE_PNG_STRATEGY_RLE,
        cv2.IMWRITE_PNG_FILTER,
        cv2.IMWRITE_PNG_FILTER_AVG,
    ]
    suffix, options = {"png": (".png", quick), "jpeg": (".jpg", [cv2.IMWRITE_JPEG_QUALITY, settings.quality])}[
        settings.format
    ]
    done, content = cv2.imencode(suffix, image if image.ndim == 2 else image[:, :, ::-1], options)
    if not done:
        raise RendererError(f"image: could not be encoded as {settings.format}")
    return content.tobytes()


def decode_image(content: bytes, name: str) -> NDArray[Any]:
    """Return an image file's bytes as (H, W) grey or (H, W, 3) RGB, uint8 or uint16.

    Raises
    ------
    ImageError
        That names the image.
    """
    return read_image(BytesIO(content), name)


def to_line(value: Any) -> bytes:
    """Return plain values as one line of JSON; nan is refused."""
    return (json.dumps(value, allow_nan=False, ensure_ascii=False, separators=(",", ":")) + "\n").encode()


def from_line(line: bytes, name: str) -> Record:
    """Return a record's line as plain values.

    Raises
    ------
    InputError
        That names the file, if the line is not a record.
    """
    try:
        record = json.loads(line)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{name}: expected one line of JSON, got {line[:40]!r}") from error
    if not isinstance(record, dict):
        raise InputError(f"{name}: expected the record of a frame, got {line[:40]!r}")
    return record


# --- the record -------------------------------------------------------------------------------------------------


def record_of(plan: FramePlan, frame: Frame, image: bytes) -> Record:
    """Return the truth about a frame as plain values; `image` is its encoded file."""
    sequence = plan.sequence
    return {
        "frame": plan.index,
        "sequence": sequence.number,
        "scene": sequence.scene_file,
        "view": sequence.view.kind,
        "time_s": plan.time_s,
        "camera": {"name": sequence.camera.name, **camera_values(plan.camera)},
        "world_from_camera": _rows(plan.world_from_camera),
        "lights": [plain_values(light) for light in plan.scene.lights],
        "sensor": asdict(plan.sensor),
        "renderer": frame.renderer,
        "gl_renderer": frame.gl_renderer,
        "picture_sha256": sha256(image).hexdigest(),
        "picture_bytes": len(image),
        "markers": _marker_values(plan.scene, plan.camera, plan.world_from_camera, frame.truth),
    }


def camera_values(camera: Camera) -> dict[str, Any]:
    """Return a camera as plain values."""
    values = {name: value for name, value in asdict(camera).items() if value is not None}
    return {**values, "distortion": list(camera.distortion)}


def marker_outlines(record: Record, markers: list[dict[str, Any]]) -> list[NDArray[np.float64]]:
    """Return (m, 2) px of what is inside the image of each of a record's markers, hidden or not; (0, 2) if nothing."""
    camera = Camera(**{name: value for name, value in record["camera"].items() if name != "name"})
    camera_from_world = invert(np.array(record["world_from_camera"]))
    return [seen_outline(camera, transform(camera_from_world, m["points_world_m"][1:])) for m in markers]


def _marker_values(scene: Scene, camera: Camera, pose: Pose, truth: tuple[MarkerTruth, ...]) -> list[dict[str, Any]]:
    """Return the markers that face the camera with anything visible, or with their centre in the image."""
    printed = {mark.name: (number, quad, mark) for number, quad in enumerate(scene.quads) for mark in quad.marks}
    listed = [marker for marker in truth if _is_listed(camera, marker)]
    world = [_world_points(*printed[marker.name][1:]) for marker in listed]
    owners = [printed[marker.name][0] for marker in listed]
    states = point_states(scene, camera, pose, np.array(world).reshape(-1, 5, 3), owners)
    return [
        {
            "name": marker.name,
            "kind": marker.kind,
            "side_m": printed[marker.name][2].side_m,
            "points_xy": [_plain(marker.center_xy), *map(_plain, marker.corners_xy)],
            "points_seen": [int(state) for state in states[i]],
            "points_world_m": _rows(world[i]),
            "side_px": float(marker.side_px) if np.isfinite(marker.side_px) else None,
            "distance_m": float(marker.distance_m),
            "tilt_deg": float(marker.tilt_deg),
            "visible_fraction": float(marker.visible_fraction),
            "bend_radius_m": None if (bend := printed[marker.name][1].bend) is None else bend.radius_m,
        }
        for i, marker in enumerate(listed)
    ]


def _is_listed(camera: Camera, marker: MarkerTruth) -> bool:
    in_picture = bool(camera.contains(marker.center_xy[None])[0])
    return marker.visible_fraction > 0 or (in_picture and marker.tilt_deg < 90)


def _world_points(quad: Any, mark: Any) -> NDArray[np.float64]:
    """Return the (5, 3) world points of a marker: centre and corners, metres."""
    corners = rectangle_m(quad, mark.center_m, (mark.side_m, mark.side_m))
    center = corners.mean(axis=0)[None] if quad.bend is None else quad.points_m([mark.center_m])
    return np.concatenate([center, corners])


def point_states(
    scene: Scene, camera: Camera, pose: Pose, points_m: NDArray[np.float64], owners: list[int]
) -> NDArray[np.int64]:
    """Return (n, 5) states UNSEEN, COVERED or SEEN of (n, 5, 3) world points on the quads of index `owners`.

    Corners are tested a thousandth of the side inside the pattern, where a ray is certain to meet their own quad.
    """
    if len(points_m) == 0:
        return np.zeros((0, 5), dtype=np.int64)
    xy = camera.project(transform(invert(pose), points_m.reshape(-1, 3)))
    in_picture = camera.contains(xy)
    drawn_in = points_m + 1e-3 * (points_m[:, :1] - points_m)
    first, reached = first_faces(solids_of(scene, quads=True), pose[:3, 3], drawn_in.reshape(-1, 3) - pose[:3, 3])
    counts = panel_counts(scene.quads)
    quad_of_panel = np.append(np.repeat(np.arange(len(counts)), counts), -1)
    seen = quad_of_panel[np.where(first < len(quad_of_panel) - 1, first, -1)] == np.repeat(owners, points_m.shape[1])
    seen &= np.abs(reached - 1) < _SAME_POINT  # bent paper may hide itself
    return np.where(in_picture, np.where(seen, SEEN, COVERED), UNSEEN).reshape(len(points_m), -1)


def _rows(matrix: NDArray[np.float64]) -> list[list[float]]:
    return [[float(value) for value in row] for row in matrix]


def _plain(xy: NDArray[np.float64]) -> list[float | None]:
    """Return a point as plain numbers, nan (behind the camera) as None."""
    return [float(value) if np.isfinite(value) else None for value in xy]
