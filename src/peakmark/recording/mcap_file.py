"""MCAP files with ROS 2 messages: what Foxglove shows, and `ros2 bag` plays.

| topic | message |
|---|---|
| /camera/image/compressed, /camera/camera_info | sensor_msgs/CompressedImage, CameraInfo |
| /camera/markers | visualization_msgs/ImageMarker: outlines of what was found |
| /tf | tf2_msgs/TFMessage: world → camera as found, world → camera_truth |
| /pose, /pose_truth | geometry_msgs/PoseWithCovarianceStamped, PoseStamped |
| /map | visualization_msgs/MarkerArray: the printed markers, once |
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from peaksim.extras import needs_extra

from peakmark.maps.marker_map import MarkerMap
from peakmark.recording.messages import Message, Messages
from peakmark.recording.moment import Moment


@needs_extra
def write_mcap(path: Path, marker_map: MarkerMap | None) -> Any:
    """Give a function that appends moments to an MCAP file, as a context."""
    from mcap.writer import Writer

    return _written(Writer(str(path)), Messages(), marker_map)


@contextmanager
def _written(writer: Any, messages: Messages, marker_map: MarkerMap | None) -> Iterator[Callable[[Moment], None]]:
    channels: dict[str, int] = {}

    def add(time_s: float, message: Message) -> None:
        if message.topic not in channels:
            text = messages.definition(message.kind).encode()
            schema = writer.register_schema(message.kind, "ros2msg", text)
            channels[message.topic] = writer.register_channel(message.topic, "cdr", schema)
        stamp_ns = round(time_s * 1e9)
        writer.add_message(channels[message.topic], stamp_ns, messages.serialized(message), stamp_ns)

    def append(moment: Moment) -> None:
        if marker_map is not None and not channels:
            add(moment.time_s, messages.of_map(marker_map, moment.time_s))
        for message in messages.of_moment(moment):
            add(moment.time_s, message)

    writer.start(profile="ros2", library="peakmark")
    try:
        yield append
    finally:
        writer.finish()
