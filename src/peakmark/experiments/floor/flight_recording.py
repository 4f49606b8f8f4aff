"""A flight as a recording: every image with its camera, what was found, and the estimated pose beside the true one."""

from pathlib import Path

from peaksim.image_file import to_8_bits

from peakmark.experiments.floor.flight import Flight, render_frame
from peakmark.experiments.floor.flight_tracking import Flown, FlownFrame
from peakmark.maps.files import scene_map
from peakmark.recording.moment import Moment
from peakmark.recording.recorder import recorder


def record_flight(path: Path, flight: Flight, flown: Flown) -> None:
    """Write a flight to an MCAP or Rerun file; its frames are rendered again.

    Raises
    ------
    InputError
        If the name has another ending, or the file cannot be written.
    """
    has_markers = any(mark.kind.startswith("surf") for quad in flight.setup.scene.quads for mark in quad.marks)
    with recorder(path, scene_map(flight.setup.scene) if has_markers else None) as append:
        for index, frame in enumerate(flown.frames):
            append(_moment(flight, flown, frame, index))


def _moment(flight: Flight, flown: Flown, frame: FlownFrame, index: int) -> Moment:
    found = [row.detection for row in frame.record.detections]
    return Moment(
        float(flown.times_s[index]),
        to_8_bits(render_frame(flight, index).image),
        flown.camera,
        tuple((str(each.polarity), each.corners()) for each in found),
        frame.map_pose if frame.map_pose is not None else frame.motion_pose,
        None,
        frame.record.world_from_camera,
    )
