"""Recordings, read by the formats' own libraries, and bags of others as sources of images."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from peaksim import Camera
from peaksim.geometry.pose import Pose, compose, look_at
from scipy.spatial.transform import Rotation

from peakmark.errors import ImageError, InputError
from peakmark.maps.marker_map import MappedArray, MarkerMap
from peakmark.recording import Moment, check_recording, is_bag, read_bag, recorder
from peakmark.recording.bag import split_topic

make_reader = pytest.importorskip("mcap.reader").make_reader
decoder = pytest.importorskip("mcap_ros2.decoder")
rosbag1 = pytest.importorskip("rosbags.rosbag1")
rosbag2 = pytest.importorskip("rosbags.rosbag2")
typesys = pytest.importorskip("rosbags.typesys")

CAMERA = Camera(64, 48, 60.0, 61.0, 31.0, 24.0, (-0.1, 0.02, 0.001, 0.0))
POSES = [look_at([0.1, 0.2, 1.0 + k], [0.0, 0.0, 0.0], [0, 1, 0.1]) for k in range(3)]
CORNERS = np.array([[10.0, 10.0], [20.0, 11.0], [21.0, 22.0], [9.0, 20.0]])
MAP = MarkerMap(
    np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.1, 0.1, 0.0]]),
    np.broadcast_to(np.array([[1.0, 0.0], [0.0, -1.0], [0.0, 0.0]]), (3, 3, 2)),
    np.full(3, 0.05),
    ("dark", "light", "dark"),
    (MappedArray(5, (0, 1, 2)),),
)


def image(number: int) -> NDArray[np.uint8]:
    """A smooth image, which JPEG keeps."""
    y, x = np.mgrid[:48, :64]
    return np.dstack([2 * x, 3 * y, x + y + 20 * number]).astype(np.uint8)


def covariance() -> NDArray[np.float64]:
    a = np.random.default_rng(0).standard_normal((6, 6))
    return np.asarray(a @ a.T)


def moments() -> Iterator[Moment]:
    for k, pose in enumerate(POSES):
        estimate = None if k == 2 else pose @ compose(np.eye(3), [0.01, 0.0, 0.0])
        found = (("array 5", CORNERS + k),)
        yield Moment(0.1 * k, image(k), CAMERA, found, estimate, covariance() if k == 0 else None, pose)


def recorded(path: Path) -> Path:
    with recorder(path, MAP) as append:
        for moment in moments():
            append(moment)
    return path


def decoded(path: Path) -> dict[str, list[tuple[int, Any]]]:
    """Return times in ns and messages by topic, as MCAP's own library decodes them."""
    found: dict[str, list[tuple[int, Any]]] = {}
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[decoder.DecoderFactory()])
        for _, channel, message, value in reader.iter_decoded_messages():
            found.setdefault(channel.topic, []).append((message.log_time, value))
    return found


def pose_of(position: Any, orientation: Any) -> Pose:
    quaternion = [orientation.x, orientation.y, orientation.z, orientation.w]
    return compose(Rotation.from_quat(quaternion).as_matrix(), [position.x, position.y, position.z])


def test_mcap_holds_images_cameras_and_poses(tmp_path: Path) -> None:
    topics = decoded(recorded(tmp_path / "new" / "a.mcap"))
    images = topics["/camera/image/compressed"]
    assert [time for time, _ in images] == [0, 100_000_000, 200_000_000]
    assert images[1][1].header.stamp.nanosec == 100_000_000
    shown = cv2.imdecode(np.frombuffer(images[1][1].data, np.uint8), cv2.IMREAD_COLOR)
    assert np.abs(shown[:, :, ::-1].astype(int) - image(1)).mean() < 4
    info = topics["/camera/camera_info"][0][1]
    assert (info.width, info.height, info.distortion_model) == (64, 48, "plumb_bob")
    assert np.allclose(np.reshape(info.k, (3, 3)), CAMERA.matrix)
    assert np.allclose(info.d, (*CAMERA.distortion, 0.0))
    steps = [{step.child_frame_id: step for step in value.transforms} for _, value in topics["/tf"]]
    assert [sorted(each) for each in steps] == [["camera", "camera_truth"]] * 2 + [["camera_truth"]]
    for k, each in enumerate(steps):
        assert each["camera_truth"].header.frame_id == "world"
        true = each["camera_truth"].transform
        assert np.allclose(pose_of(true.translation, true.rotation), POSES[k])
    (_, box, *_), text = topics["/map"][0][1].markers[:3], topics["/map"][0][1].markers[3]
    assert (box.pose.position.x, box.scale.x, text.text) == (0.1, 0.05, "5")
    assert len(topics["/map"]) == 1
    lines = topics["/camera/markers"][1][1]
    assert [(p.x, p.y) for p in lines.points[:3]] == [(11.0, 11.0), (21.0, 12.0), (21.0, 12.0)]


def test_the_covariance_is_about_the_axes_of_the_world(tmp_path: Path) -> None:
    """Small steps, drawn in the camera's frame, spread in the world as the message says."""
    topics = decoded(recorded(tmp_path / "a.mcap"))
    told = topics["/pose"][0][1].pose
    pose = pose_of(told.pose.position, told.pose.orientation)
    steps = np.random.default_rng(1).multivariate_normal(np.zeros(6), 1e-8 * covariance(), 4000)
    moved = [pose @ compose(Rotation.from_rotvec(step[:3]).as_matrix(), step[3:]) for step in steps]
    turned = [Rotation.from_matrix(each[:3, :3] @ pose[:3, :3].T).as_rotvec() for each in moved]
    spread = np.cov(np.column_stack([[each[:3, 3] for each in moved], turned]).T) * 1e8
    assert np.abs(spread - np.reshape(told.covariance, (6, 6))).max() < 0.1 * np.abs(spread).max()
    assert topics["/pose"][1][1].pose.covariance[0] == -1


def test_a_fisheye_is_equidistant(tmp_path: Path) -> None:
    wide = Camera(64, 48, 30.0, distortion=(0.01, 0.0, 0.0, 0.0), model="fisheye")
    with recorder(tmp_path / "a.mcap") as append:
        append(Moment(0.0, image(0), wide))
    topics = decoded(tmp_path / "a.mcap")
    assert topics.keys() == {"/camera/image/compressed", "/camera/camera_info"}
    assert topics["/camera/camera_info"][0][1].distortion_model == "equidistant"


def test_rerun_reads_its_recording(tmp_path: Path) -> None:
    pytest.importorskip("rerun")
    chunk = pytest.importorskip("rerun.chunk", reason="this rerun cannot read recordings")
    chunks = list(chunk.RrdReader(str(recorded(tmp_path / "a.rrd"))).stream())
    assert {str(each.entity_path).lstrip("/") for each in chunks} >= {
        *("world/markers", "world/camera", "world/camera/picture", "world/camera/picture/found"),
        *("world/estimate", "world/truth", "world/estimate/path", "world/truth/path"),
    }


def test_another_ending_is_refused() -> None:
    with pytest.raises(InputError, match=r"--record a\.txt: expected a name ending in \.mcap or \.rrd"):
        check_recording(Path("a.txt"))


# --- sources --------------------------------------------------------------------------------------------------


def test_what_was_recorded_is_a_source(tmp_path: Path) -> None:
    frames = list(read_bag(str(recorded(tmp_path / "a.mcap"))))
    assert [time_s for time_s, _ in frames] == pytest.approx([0.0, 0.1, 0.2])
    assert all(np.abs(shown.astype(int) - image(k)).mean() < 4 for k, (_, shown) in enumerate(frames))


def raw_message(store: Any, pixels: NDArray[Any], encoding: str, stamp_s: int, is_ros1: bool = False) -> Any:
    types, (height, width) = store.types, pixels.shape[:2]
    stamp = types["builtin_interfaces/msg/Time"](sec=stamp_s, nanosec=0)
    seq = {"seq": 0} if is_ros1 else {}
    data = np.ascontiguousarray(pixels).view(np.uint8).reshape(height, -1)
    padded = np.pad(data, ((0, 0), (0, 4)))  # rows may be longer than their pixels
    return types["sensor_msgs/msg/Image"](
        header=types["std_msgs/msg/Header"](stamp=stamp, frame_id="c", **seq),
        height=height,
        width=width,
        encoding=encoding,
        is_bigendian=0,
        step=padded.shape[1],
        data=padded.ravel(),
    )


GREY = image(0)[:, :, 1]
ENCODED = {
    "mono8": (GREY, GREY),
    "mono16": (GREY.astype(np.uint16) * 257, GREY.astype(np.uint16) * 257),
    "rgb8": (image(0), image(0)),
    "bgr8": (image(0)[:, :, ::-1], image(0)),
    "bgra8": (np.dstack([image(0)[:, :, ::-1], GREY]), image(0)),
}


def write_ros2(path: Path, encodings: dict[str, str], plugin: str) -> Path:
    """Write a ROS 2 bag with one image of each encoding, on the topics that they are given."""
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    storage = getattr(rosbag2.StoragePlugin, plugin)
    with rosbag2.Writer(path, version=9, storage_plugin=storage) as writer:
        for k, (encoding, topic) in enumerate(encodings.items()):
            connection = writer.add_connection(topic, "sensor_msgs/msg/Image", typestore=store)
            message = raw_message(store, ENCODED[encoding][0], encoding, 100 + k)
            writer.write(connection, (100 + k) * 10**9, store.serialize_cdr(message, "sensor_msgs/msg/Image"))
    return path


@pytest.mark.parametrize("plugin", ["SQLITE3", "MCAP"])
@pytest.mark.parametrize("encoding", ENCODED)
def test_bags_of_ros_2_are_sources(tmp_path: Path, encoding: str, plugin: str) -> None:
    bag = write_ros2(tmp_path / "bag", {encoding: "/left"}, plugin)
    assert is_bag(str(bag))
    ((time_s, shown),) = read_bag(str(bag))
    assert (time_s, shown.dtype) == (0.0, ENCODED[encoding][1].dtype)
    assert np.array_equal(shown, ENCODED[encoding][1])


def test_bags_of_ros_1_are_sources(tmp_path: Path) -> None:
    store = typesys.get_typestore(typesys.Stores.ROS1_NOETIC)
    with rosbag1.Writer(tmp_path / "a.bag") as writer:
        connection = writer.add_connection("/left", "sensor_msgs/msg/Image", typestore=store)
        for k in range(2):
            message = raw_message(store, GREY, "mono8", 7 + k, is_ros1=True)
            writer.write(connection, (7 + k) * 10**9, store.serialize_ros1(message, "sensor_msgs/msg/Image"))
    frames = list(read_bag(str(tmp_path / "a.bag")))
    assert [time_s for time_s, _ in frames] == [0.0, 1.0]
    assert np.array_equal(frames[0][1], GREY)


def test_one_of_several_topics_is_chosen(tmp_path: Path) -> None:
    bag = write_ros2(tmp_path / "bag", {"mono8": "/left", "rgb8": "/right"}, "MCAP")
    assert split_topic(f"{bag}#/right") == (bag, "/right")
    ((_, shown),) = read_bag(f"{bag}#/right")
    assert shown.shape == (48, 64, 3)
    with pytest.raises(ImageError, match=r"bag: expected one topic of images, as in BAG#/left, got /left, /right"):
        list(read_bag(str(bag)))
    with pytest.raises(ImageError, match=r"bag: expected images in /up, got /left, /right"):
        list(read_bag(f"{bag}#/up"))


def test_bad_bags_are_one_line(tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_bytes(b"\x89MCAP0\r\n" + bytes(40))
    for name, words in (("a.mcap", "expected a bag"), ("b.mcap", "cannot be read: No such file")):
        with pytest.raises(ImageError, match=words) as caught:
            list(read_bag(str(tmp_path / name)))
        assert len(str(caught.value).splitlines()) == 1
    whole = recorded(tmp_path / "c.mcap").read_bytes()
    (tmp_path / "c.mcap").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(ImageError, match=r"c\.mcap: expected a bag"):
        list(read_bag(str(tmp_path / "c.mcap")))
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    message = raw_message(store, GREY, "mono8", 1)
    message.height = 2**31
    with rosbag2.Writer(tmp_path / "bag", version=9, storage_plugin=rosbag2.StoragePlugin.MCAP) as writer:
        connection = writer.add_connection("/left", "sensor_msgs/msg/Image", typestore=store)
        writer.write(connection, 1, store.serialize_cdr(message, "sensor_msgs/msg/Image"))
    with pytest.raises(ImageError, match="expected 64×2147483648 px, got rows of 68 bytes"):
        list(read_bag(str(tmp_path / "bag")))


@pytest.mark.parametrize(("library", "path"), [("mcap", "a.mcap"), ("rosbags", "a.mcap"), ("rerun", "a.rrd")])
def test_without_the_library_the_way_to_get_it_is_told(
    library: str, path: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in [name for name in __import__("sys").modules if name.split(".")[0] == library] + [library]:
        monkeypatch.setitem(__import__("sys").modules, module, None)
    extra = "rerun" if library == "rerun" else "ros"
    with pytest.raises(ModuleNotFoundError, match=rf"pip install 'peakmark\[{extra}\]'"), recorder(tmp_path / path):
        pass
