"""Moments as ROS 2 messages, serialised by the library `rosbags`."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import scipy
from numpy.typing import NDArray
from peaksim.camera.camera import Camera
from peaksim.geometry.pose import Pose, compose

from peakmark.maps.marker_map import MarkerMap
from peakmark.recording.moment import Moment

WORLD, CAMERA, TRUTH = "world", "camera", "camera_truth"
"""Frames; the camera's has x right, y down, z ahead, which ROS calls optical (REP 103)."""

_JPEG_QUALITY = 90
_SHEET_M = 0.001
"""Thickness of a printed marker in the world."""
_OUTLINE_PX = 2.0
_FOUND, _PAPER, _INK = (0.1, 0.9, 0.2), (0.95, 0.95, 0.95), (0.1, 0.1, 0.1)
"""Colours, RGB 0…1, of outlines, and of markers with a light and with a dark centre."""


@dataclass(frozen=True)
class Message:
    """A message and where it goes."""

    topic: str
    kind: str
    """Such as "sensor_msgs/msg/CameraInfo"."""
    value: Any
    """Of that type, as `rosbags` makes them."""


class Messages:
    """Makes messages; it needs the extra `ros`."""

    def __init__(self) -> None:
        from rosbags.typesys import Stores, get_typestore

        self._store = get_typestore(Stores.ROS2_HUMBLE)

    def definition(self, kind: str) -> str:
        """Return the text that defines a kind of message, and those that it is made of."""
        text, _ = self._store.generate_msgdef(kind, ros_version=2)
        return str(text)

    def serialized(self, message: Message) -> bytes:
        """Return a message as it is sent (CDR)."""
        return bytes(self._store.serialize_cdr(message.value, message.kind))

    def of_moment(self, moment: Moment) -> Iterator[Message]:
        """Yield the messages of a moment."""
        yield self._image(moment)
        if moment.camera is not None:
            yield self._camera_info(moment.camera, moment.time_s)
        if moment.outlines:
            yield self._outlines(moment)
        placed = [(CAMERA, moment.estimate), (TRUTH, moment.truth)]
        steps = [self._transform(moment.time_s, name, pose) for name, pose in placed if pose is not None]
        if steps:
            yield self._message("/tf", "tf2_msgs/msg/TFMessage", transforms=steps)
        if moment.estimate is not None:
            yield self._pose_with_covariance(moment)
        if moment.truth is not None:
            header, pose = self._header(moment.time_s, WORLD), self._pose(moment.truth)
            yield self._message("/pose_truth", "geometry_msgs/msg/PoseStamped", header=header, pose=pose)

    def of_map(self, marker_map: MarkerMap, time_s: float) -> Message:
        """Return the markers of a map as flat boxes, and the codes of arrays as texts."""
        boxes = [self._box(marker_map, row, time_s) for row in range(len(marker_map))]
        texts = [
            self._text(str(array.code), marker_map.centers_m[list(array.rows)].mean(axis=0), array.code, time_s)
            for array in marker_map.arrays
        ]
        return self._message("/map", "visualization_msgs/msg/MarkerArray", markers=[*boxes, *texts])

    # --- parts ------------------------------------------------------------------------------------------------

    def _new(self, kind: str, **values: Any) -> Any:
        return self._store.types[kind](**values)

    def _message(self, topic: str, kind: str, **values: Any) -> Message:
        return Message(topic, kind, self._new(kind, **values))

    def _header(self, time_s: float, frame: str) -> Any:
        seconds, nanoseconds = divmod(round(time_s * 1e9), 10**9)
        stamp = self._new("builtin_interfaces/msg/Time", sec=seconds, nanosec=nanoseconds)
        return self._new("std_msgs/msg/Header", stamp=stamp, frame_id=frame)

    def _image(self, moment: Moment) -> Message:
        image = moment.image if moment.image.ndim == 2 else np.ascontiguousarray(moment.image[:, :, ::-1])
        _, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
        header = self._header(moment.time_s, CAMERA)
        kind = "sensor_msgs/msg/CompressedImage"
        return self._message("/camera/image/compressed", kind, header=header, format="jpeg", data=data.ravel())

    def _camera_info(self, camera: Camera, time_s: float) -> Message:
        model, count = ("equidistant", 4) if camera.model == "fisheye" else ("plumb_bob", 5)
        if len(camera.distortion) > count:
            model, count = "rational_polynomial", 8
        k = np.pad(np.array(camera.distortion, dtype=np.float64), (0, max(0, count - len(camera.distortion))))
        roi = self._new("sensor_msgs/msg/RegionOfInterest", **_REGION)
        return self._message(
            "/camera/camera_info",
            "sensor_msgs/msg/CameraInfo",
            header=self._header(time_s, CAMERA),
            height=camera.height,
            width=camera.width,
            distortion_model=model,
            d=k[:count],
            k=camera.matrix.ravel(),
            r=np.eye(3).ravel(),
            p=np.column_stack([camera.matrix, np.zeros(3)]).ravel(),
            binning_x=0,
            binning_y=0,
            roi=roi,
        )

    def _outlines(self, moment: Moment) -> Message:
        ends = [xy for _, corners in moment.outlines for pair in _edges(corners) for xy in pair]
        origin = self._point((0.0, 0.0, 0.0))
        return self._message(
            "/camera/markers",
            "visualization_msgs/msg/ImageMarker",
            header=self._header(moment.time_s, CAMERA),
            ns="found",
            id=0,
            type=2,  # LINE_LIST
            action=0,
            position=origin,
            scale=_OUTLINE_PX,
            outline_color=self._colour(_FOUND),
            filled=0,
            fill_color=self._colour(_FOUND),
            lifetime=self._duration(),
            points=[self._point((float(x), float(y), 0.0)) for x, y in ends],
            outline_colors=[],
        )

    def _transform(self, time_s: float, child: str, pose: Pose) -> Any:
        x, y, z = map(float, pose[:3, 3])
        shift = self._new("geometry_msgs/msg/Vector3", x=x, y=y, z=z)
        step = self._new("geometry_msgs/msg/Transform", translation=shift, rotation=self._quaternion(pose))
        kind = "geometry_msgs/msg/TransformStamped"
        return self._new(kind, header=self._header(time_s, WORLD), child_frame_id=child, transform=step)

    def _pose_with_covariance(self, moment: Moment) -> Message:
        assert moment.estimate is not None
        pose, unknown = self._pose(moment.estimate), np.zeros((6, 6))
        unknown[0, 0] = -1.0  # as ROS marks a covariance that is not known
        spread = unknown if moment.covariance is None else _world_covariance(moment.estimate, moment.covariance)
        value = self._new("geometry_msgs/msg/PoseWithCovariance", pose=pose, covariance=spread.ravel())
        header = self._header(moment.time_s, WORLD)
        return self._message("/pose", "geometry_msgs/msg/PoseWithCovarianceStamped", header=header, pose=value)

    def _pose(self, pose: Pose) -> Any:
        position = self._point(tuple(map(float, pose[:3, 3])))
        return self._new("geometry_msgs/msg/Pose", position=position, orientation=self._quaternion(pose))

    def _quaternion(self, pose: Pose) -> Any:
        x, y, z, w = map(float, scipy.spatial.transform.Rotation.from_matrix(pose[:3, :3]).as_quat(canonical=True))
        return self._new("geometry_msgs/msg/Quaternion", x=x, y=y, z=z, w=w)

    def _point(self, xyz: tuple[float, ...]) -> Any:
        x, y, z = xyz
        return self._new("geometry_msgs/msg/Point", x=x, y=y, z=z)

    def _colour(self, rgb: tuple[float, float, float]) -> Any:
        r, g, b = rgb
        return self._new("std_msgs/msg/ColorRGBA", r=r, g=g, b=b, a=1.0)

    def _duration(self) -> Any:
        return self._new("builtin_interfaces/msg/Duration", sec=0, nanosec=0)

    def _box(self, marker_map: MarkerMap, row: int, time_s: float) -> Any:
        right, down = marker_map.axes[row].T
        pose = compose(np.column_stack([right, -down, np.cross(right, -down)]), marker_map.centers_m[row])
        side = float(marker_map.sides_m[row])
        colour = _INK if marker_map.polarities[row] == "dark" else _PAPER
        return self._marker("markers", row, 1, pose, (side, side, _SHEET_M), colour, time_s)

    def _text(self, text: str, center_m: NDArray[np.float64], code: int, time_s: float) -> Any:
        pose = compose(np.eye(3), center_m)
        return self._marker("codes", code, 9, pose, (0.0, 0.0, 0.05), _FOUND, time_s, text)

    def _marker(
        self,
        group: str,
        number: int,
        shape: int,
        pose: Pose,
        scale: tuple[float, float, float],
        colour: tuple[float, float, float],
        time_s: float,
        text: str = "",
    ) -> Any:
        x, y, z = scale
        texture = self._new(
            "sensor_msgs/msg/CompressedImage", header=self._header(0, ""), format="", data=np.zeros(0, np.uint8)
        )
        return self._new(
            "visualization_msgs/msg/Marker",
            header=self._header(time_s, WORLD),
            ns=group,
            id=number,
            type=shape,
            action=0,
            pose=self._pose(pose),
            scale=self._new("geometry_msgs/msg/Vector3", x=x, y=y, z=z),
            color=self._colour(colour),
            lifetime=self._duration(),
            frame_locked=False,
            points=[],
            colors=[],
            texture_resource="",
            texture=texture,
            uv_coordinates=[],
            text=text,
            mesh_resource="",
            mesh_file=self._new("visualization_msgs/msg/MeshFile", filename="", data=np.zeros(0, np.uint8)),
            mesh_use_embedded_materials=False,
        )


_REGION = {"x_offset": 0, "y_offset": 0, "height": 0, "width": 0, "do_rectify": False}


def _edges(corners: NDArray[np.float64]) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    return zip(corners, np.roll(corners, -1, axis=0), strict=True)


def _world_covariance(pose: Pose, covariance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return ROS's covariance (x, y, z, then rotation about the world's axes) of a step in the camera's frame."""
    by_step = np.zeros((6, 6))
    by_step[:3, 3:] = by_step[3:, :3] = pose[:3, :3]
    return np.asarray(by_step @ covariance @ by_step.T)
