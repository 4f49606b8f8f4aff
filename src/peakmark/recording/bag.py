"""Images of MCAP files, ROS 2 bags (folders with metadata.yaml) and ROS 1 bags, through the library `rosbags`."""

from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from peaksim.extras import needs_extra
from peaksim.image_file import MAX_PIXELS, read_image

from peakmark.errors import ImageError, InputError

BAG_ENDINGS = (".mcap", ".bag")

_METADATA = "metadata.yaml"

_RAW, _COMPRESSED = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"

_LAYOUTS: dict[str, tuple[int, type[np.generic], int | None]] = {
    "mono8": (1, np.uint8, None),
    "8UC1": (1, np.uint8, None),
    "mono16": (1, np.uint16, None),
    "16UC1": (1, np.uint16, None),
    "rgb8": (3, np.uint8, None),
    "bgr8": (3, np.uint8, cv2.COLOR_BGR2RGB),
    "8UC3": (3, np.uint8, cv2.COLOR_BGR2RGB),
    "rgba8": (4, np.uint8, cv2.COLOR_RGBA2RGB),
    "bgra8": (4, np.uint8, cv2.COLOR_BGRA2RGB),
    "yuv422_yuy2": (2, np.uint8, cv2.COLOR_YUV2RGB_YUY2),
    "yuv422": (2, np.uint8, cv2.COLOR_YUV2RGB_UYVY),
    "bayer_rggb8": (1, np.uint8, cv2.COLOR_BayerRGGB2RGB),
    "bayer_bggr8": (1, np.uint8, cv2.COLOR_BayerBGGR2RGB),
    "bayer_gbrg8": (1, np.uint8, cv2.COLOR_BayerGBRG2RGB),
    "bayer_grbg8": (1, np.uint8, cv2.COLOR_BayerGRBG2RGB),
}
"""Encoding → values a pixel, their type, and OpenCV's conversion to RGB."""


def is_bag(source: str) -> bool:
    """Return whether a source, BAG or BAG#TOPIC, names a bag."""
    path, _ = split_topic(source)
    return path.suffix.lower() in BAG_ENDINGS or (path / _METADATA).is_file()


def split_topic(source: str) -> tuple[Path, str | None]:
    """Return the bag of BAG#TOPIC, and the topic; None for BAG alone."""
    name, _, topic = source.rpartition("#")
    return (Path(name), topic) if name and not Path(source).exists() else (Path(source), None)


@needs_extra
def read_bag(source: str) -> Iterator[tuple[float, NDArray[Any]]]:
    """Yield the images of a bag's one topic of images, or of the one that BAG#TOPIC names, with their times.

    Times are seconds from the first image, by the stamps of the messages' headers, or by the time of recording where
    they have none. Images are (H, W) or (H, W, 3) RGB.

    Raises
    ------
    ImageError
        If the bag is damaged or missing, has no such topic or several of them, or an image that is none.
    """
    from rosbags.highlevel import AnyReader, AnyReaderError
    from rosbags.typesys import Stores, get_typestore

    path, topic = split_topic(source)
    if not path.exists():
        raise ImageError(f"{path}: cannot be read: No such file or directory")
    try:
        with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
            chosen = _chosen(reader.connections, topic)
            first: float | None = None
            for connection, recorded_ns, raw in reader.messages(chosen):
                message: Any = reader.deserialize(raw, connection.msgtype)
                stamp = message.header.stamp
                time_s = (stamp.sec + stamp.nanosec / 1e9) or recorded_ns / 1e9
                first = time_s if first is None else first
                yield time_s - first, _image(message, connection.msgtype)
            if first is None:
                raise ImageError("found no image")
    except InputError as error:
        raise ImageError(f"{path}: {error}") from error
    except (AnyReaderError, OSError, ValueError, KeyError, EOFError, cv2.error) as error:
        raise ImageError(f"{path}: expected a bag (MCAP, ROS 2 or ROS 1): {str(error) or repr(error):.200}") from error


def _chosen(connections: Any, topic: str | None) -> list[Any]:
    """Return the connections of the one topic of images."""
    images = [each for each in connections if each.msgtype in (_RAW, _COMPRESSED)]
    topics = sorted({each.topic for each in images})
    if topic is None and len(topics) > 1:
        raise ImageError(f"expected one topic of images, as in BAG#{topics[0]}, got {', '.join(topics)}")
    found = [each for each in images if topic in (None, each.topic)]
    if not found:
        others = sorted({each.topic for each in connections})
        expected = "a topic of images" if topic is None else f"images in {topic}"
        raise ImageError(f"expected {expected}, got {', '.join(topics or others) or 'no topic'}")
    return found


def _image(message: Any, kind: str) -> NDArray[Any]:
    if kind == _COMPRESSED:
        return read_image(BytesIO(bytes(message.data)), "image", is_upright=False)
    if message.encoding not in _LAYOUTS:
        raise ImageError(f"expected images encoded as one of {', '.join(_LAYOUTS)}, got {message.encoding!r:.40}")
    channels, kind_of, conversion = _LAYOUTS[message.encoding]
    width, height, step = int(message.width), int(message.height), int(message.step)
    row = width * channels * np.dtype(kind_of).itemsize
    if not (0 < width * height <= MAX_PIXELS and row <= step and len(message.data) >= step * height):
        raise ImageError(f"expected {width}×{height} px, got rows of {step} bytes, {len(message.data)} in all")
    order = np.dtype(kind_of).newbyteorder(">" if message.is_bigendian else "<")
    rows = np.frombuffer(bytes(message.data), np.uint8, step * height).reshape(height, step)[:, :row]
    values = np.ascontiguousarray(rows).view(order).astype(kind_of).reshape(height, width, channels)
    pixels = values[:, :, 0] if channels == 1 else values
    return np.asarray(pixels if conversion is None else cv2.cvtColor(pixels, conversion))
