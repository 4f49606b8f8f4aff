"""Poses for `peakmark identify`: the camera of each image, where it is on the map, and the files of poses."""

import csv
import json
from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray
from peaksim.camera.camera import Camera, resized
from peaksim.camera.guess import PHONE_35MM, guessed_camera
from peaksim.exif_file import focal_35mm_of
from peaksim.geometry.trajectory import Trajectory
from peaksim.geometry.trajectory_file import save_trajectory
from peaksim.image_file import read_image
from peaksim.whole_file import whole_file

from peakmark.cli.sources import SourceImage
from peakmark.errors import ImageError, InputError
from peakmark.maps.locate import Location
from peakmark.maps.marker_map import MarkerMap
from peakmark.maps.pose_columns import pose_columns


@dataclass(frozen=True)
class PoseRecord:
    """Where the camera was for one image, as plain values."""

    world_from_camera: NDArray[np.float64]
    """(4, 4)."""
    covariance: NDArray[np.float64]
    """(6, 6), see `Location`."""
    position_sigma_m: NDArray[np.float64]
    """(3,) world."""
    rotation_sigma_deg: float
    """Root of the sum over three axes."""
    markers: int
    """Of the map that were seen."""
    rms_px: float
    """Reprojection error of their centres."""
    is_certain: bool
    """Whether no other pose explains the image nearly as well."""
    other: NDArray[np.float64] | None
    """(4, 4) the second solution; None without one."""
    page: int | None
    """Sheet of paper whose frame it is in."""


@dataclass(frozen=True)
class Locator:
    """What poses are computed from."""

    calibration: Camera | None
    """None guesses the field of view."""
    name: str
    """What messages call the calibration."""
    marker_map: MarkerMap | None
    """None gives undistorted positions alone."""
    may_scale: bool = False
    """Whether the calibration is scaled to images of another size and the same shape."""

    def read(self, path: Path) -> NDArray[Any]:
        """Return an image as the calibration was made of it: the sensor's own pixels if they are of its size."""
        if self.calibration is None:
            return read_image(path)
        raw = read_image(path, is_upright=False)
        shape = np.array([raw.shape[1], raw.shape[0]]) * (self.calibration.height, self.calibration.width)
        return raw if abs(shape[0] - shape[1]) <= 2 * max(raw.shape[:2]) else read_image(path)

    def camera_of(self, each: SourceImage) -> Camera:
        """Return the camera of an image.

        Raises
        ------
        ImageError
            If the calibration is of another size.
        """
        height, width = each.image.shape[:2]
        if self.calibration is None:
            return guessed_camera(width, height, focal_35mm_of(each.file))
        stated = (self.calibration.width, self.calibration.height)
        if stated == (width, height):
            return self.calibration
        scaled = resized(self.calibration, width / stated[0])
        is_alike = (scaled.width, scaled.height) == (width, height)
        if self.may_scale and is_alike:
            return scaled
        todo = "--scale-calibration if it is a smaller or larger copy" if is_alike else "calibrate with such images"
        if stated == (height, width):
            todo = "it is rotated by 90°: calibrate with images that are held alike"
        raise ImageError(
            f"{each.file}: expected {stated[0]}×{stated[1]} px, the size of {self.name}, got {width}×{height}; {todo}"
        )

    def assumption(self, each: SourceImage) -> str:
        """Return what is taken for granted about the camera of an image, in words; empty where it is calibrated."""
        if self.calibration is not None:
            return ""
        stated = focal_35mm_of(each.file)
        source = "in its EXIF" if stated else "of most phones"
        return (
            f"no --calibration: taking the focal length {source}, {stated or PHONE_35MM:g} mm on 35 mm film, and no "
            "distortion; distances are off by as much as it is"
        )


def record_of(where: Location) -> PoseRecord:
    """Return a location as plain values."""
    return PoseRecord(
        where.world_from_camera,
        where.covariance,
        where.position_sigma_m,
        where.rotation_sigma_deg,
        where.markers,
        where.rms_px,
        where.is_certain,
        where.other,
        where.page,
    )


# --- files ----------------------------------------------------------------------------------------------------

ENDINGS = (".tum", ".txt", ".csv", ".jsonl")
"""Of files of poses: TUM for the first two, with everything else in a CSV file beside it."""


@dataclass(frozen=True)
class StampedPose:
    """A pose with the image that it belongs to."""

    file: str
    frame: int | None
    """See `SourceImage`."""
    stamp: float
    """Seconds in a film or of a camera; of an image its number in the run, from 0."""
    record: PoseRecord


def write_poses(path: Path, poses: Iterable[StampedPose]) -> list[Path]:
    """Write poses as they come and return the files: PATH, and PATH.csv beside a TUM file, each whole or not at all.

    Raises
    ------
    InputError
        If the name has another ending, or cannot be written.
    """
    check_ending(path)
    is_tum = path.suffix in (".tum", ".txt")
    files = [path, path.with_suffix(".csv")] if is_tum else [path]
    stamps: list[float] = []
    placed: list[NDArray[np.float64]] = []
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with ExitStack() as stack:
            unfinished = [stack.enter_context(whole_file(file)) for file in files]
            table = stack.enter_context(
                unfinished[-1].open("w", newline="", encoding="utf-8", errors="backslashreplace")
            )
            write = _add_json_line if path.suffix == ".jsonl" else _add_row
            for pose in poses:
                write(table, pose, not stamps)
                stamps.append(pose.stamp)
                placed += [pose.record.world_from_camera] if is_tum else []
            if not stamps and path.suffix != ".jsonl":
                table.write("file,frame,stamp\n")
            if placed:
                save_trajectory(Trajectory(np.array(stamps), np.array(placed)), unfinished[0])
            elif is_tum:
                unfinished[0].write_text("# no pose\n", encoding="utf-8")
    except OSError as error:
        raise InputError(f"--poses {path}: expected a file that can be written: {error.strerror or error}") from error
    return files


def are_in_order(stamps: Sequence[float]) -> bool:
    """Return whether stamps grow; those of several films, or of films and images, may not."""
    return all(a < b for a, b in pairwise(stamps))


def check_ending(path: Path) -> None:
    """Refuse a file of poses by its ending."""
    if path.suffix not in ENDINGS:
        raise InputError(f"--poses {path}: expected a name ending in {', '.join(ENDINGS)}")


def _flat(pose: StampedPose) -> dict[str, Any]:
    """Return the columns of a pose."""
    return {"file": pose.file, "frame": pose.frame, "stamp": pose.stamp, **pose_columns(pose.record)}


def _add_row(file: IO[str], pose: StampedPose, is_first: bool) -> None:
    row = _flat(pose)
    writer = csv.DictWriter(file, list(row))
    if is_first:
        writer.writeheader()
    writer.writerow(row)


def _add_json_line(file: IO[str], pose: StampedPose, is_first: bool) -> None:
    file.write(json.dumps(_flat(pose), ensure_ascii=False, allow_nan=False) + "\n")
