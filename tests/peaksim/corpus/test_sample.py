"""Samples: images that decode to what was rendered, and records that say the truth."""

from pathlib import Path

import numpy as np
import pytest
from peaksim.camera.camera import Camera
from peaksim.corpus import make_corpus, open_corpus
from peaksim.corpus.plan import FramePlan, plan_frame
from peaksim.corpus.sample import (
    COVERED,
    SEEN,
    UNSEEN,
    decode_image,
    encode_image,
    from_line,
    make_sample,
    point_states,
    record_of,
    render_frame,
    to_line,
)
from peaksim.corpus.spec import PictureTable
from peaksim.errors import ImageError, InputError
from peaksim.geometry.pose import compose, look_at
from peaksim.scene.scene import Mark, Quad, Scene, rectangle_m
from peaksim.scene.texture import Texture

from tests.peaksim.corpus.helpers import tiny_spec


@pytest.fixture
def plan(folder: Path) -> FramePlan:
    return plan_frame(tiny_spec(light={"ambient": 0.9, "directional": 0.1}), folder, 1)


@pytest.mark.parametrize("shape", [(5, 7), (5, 7, 3)])
def test_png_keeps_every_level(shape: tuple[int, ...]) -> None:
    image = np.random.default_rng(0).integers(0, 256, shape).astype(np.uint8)
    assert np.array_equal(decode_image(encode_image(image, PictureTable()), "x"), image)


def test_jpeg_keeps_colours_apart_and_follows_its_quality() -> None:
    image = np.zeros((16, 16, 3), np.uint8)
    image[:, :] = [200, 100, 50]
    fine, coarse = (encode_image(image, PictureTable(format="jpeg", quality=quality)) for quality in (98, 20))
    assert np.abs(decode_image(fine, "x").astype(int) - [200, 100, 50]).max() <= 3
    noise = np.random.default_rng(0).integers(0, 256, (64, 64)).astype(np.uint8)
    assert len(encode_image(noise, PictureTable(format="jpeg", quality=20))) < len(
        encode_image(noise, PictureTable(format="jpeg", quality=98))
    )
    assert coarse[:3] == b"\xff\xd8\xff"


def test_a_damaged_image_is_named() -> None:
    with pytest.raises(ImageError, match=r"frames/7\.png: .*expected an image"):
        decode_image(b"no image", "frames/7.png")


def test_the_image_is_the_rendered_frame_and_the_record_vouches_for_it(plan: FramePlan) -> None:
    import hashlib

    sample = make_sample(plan, "exact", PictureTable())
    record = from_line(sample.record, "x")
    assert np.array_equal(decode_image(sample.image, "x"), render_frame(plan, "exact").image)
    assert record["picture_sha256"] == hashlib.sha256(sample.image).hexdigest()
    assert sample == make_sample(plan, "exact", PictureTable())


def test_the_record_holds_camera_pose_light_sensor_and_truth(plan: FramePlan) -> None:
    frame = render_frame(plan, "exact")
    record = from_line(to_line(record_of(plan, frame, b"")), "x")
    assert (record["frame"], record["sequence"], record["scene"], record["view"]) == (1, 0, "tiny.toml", "marker")
    distortion = tuple(record["camera"].pop("distortion"))
    assert Camera(**{k: v for k, v in record["camera"].items() if k != "name"}, distortion=distortion) == plan.camera
    assert record["world_from_camera"] == plan.world_from_camera.tolist()
    assert [light["kind"] for light in record["lights"]] == ["ambient", "directional"]
    assert record["sensor"]["read_noise"] == plan.sensor.read_noise
    assert record["markers"]
    truth = {t.name: t for t in frame.truth}
    for marker in record["markers"]:
        t = truth[marker["name"]]
        assert marker["points_xy"] == [t.center_xy.tolist(), *t.corners_xy.tolist()]
        assert [marker[k] for k in ("kind", "side_px", "distance_m", "tilt_deg", "visible_fraction")] == [
            t.kind,
            t.side_px,
            t.distance_m,
            t.tilt_deg,
            t.visible_fraction,
        ]
        world = np.array(marker["points_world_m"])
        assert np.linalg.norm(world[1] - world[2]) == pytest.approx(marker["side_m"])
        assert np.linalg.norm(world[0] - plan.world_from_camera[:3, 3]) == pytest.approx(t.distance_m)


def card(name: str, x: float, height: float, side: float = 0.2) -> Quad:
    """Return a marker that lies flat at (x, 0, height)."""
    texture = Texture.from_array(np.full((2, 2), 100, np.uint8))
    return Quad(name, texture, (side, side), compose(np.eye(3), [x, 0, height]), Mark(name, "surf-dark", side))


def test_points_are_seen_covered_or_outside() -> None:
    camera = Camera(100, 100, 100, 100, 49.5, 49.5)
    pose = look_at([0, 0, 1], [0, 0, 0], up=[0, 1, 0])  # from above: x right, y up; the image spans ±0.5 m
    scene = Scene((card("low", 0.0, 0.0), card("lid", 0.1, 0.1, 0.18), card("edge", 0.5, 0.0)))
    points = np.array(
        [np.concatenate([(c := rectangle_m(quad, (0, 0), quad.size_m)).mean(axis=0)[None], c]) for quad in scene.quads]
    )
    states = point_states(scene, camera, pose, points, [0, 1, 2])
    # the lid hides the low card's right corners but not its centre or left corners; the edge card is half outside
    assert states[0].tolist() == [SEEN, SEEN, COVERED, COVERED, SEEN]
    assert states[1].tolist() == [SEEN] * 5
    assert states[2].tolist()[1:] == [SEEN, UNSEEN, UNSEEN, SEEN]


def test_no_markers_have_no_states() -> None:
    assert point_states(Scene(), Camera(), np.eye(4), np.zeros((0, 5, 3)), []).shape == (0, 5)


@pytest.mark.parametrize("line", [b"", b"{", b"[1]", b"\xff\xfe"])
def test_a_line_that_is_no_record_is_named(line: bytes) -> None:
    with pytest.raises(InputError, match=r"00000003\.json: expected"):
        from_line(line, "00000003.json")


def test_nan_never_gets_into_a_record() -> None:
    with pytest.raises(ValueError, match="JSON"):
        to_line({"x": float("nan")})


def test_images_of_sixteen_bits_come_back_as_they_were_taken(folder: Path, tmp_path: Path) -> None:
    sensor = {"presets": ["dslr"], "bits": 12, "jpeg_quality": 0}
    spec = tiny_spec(frames=2, sensor=sensor, store={"shard_frames": 2, "part_frames": 2})
    make_corpus(spec, folder, str(tmp_path / "c"))
    corpus = open_corpus(str(tmp_path / "c"))
    taken = render_frame(plan_frame(spec, folder, 1), "exact").image
    assert taken.dtype == np.uint16
    assert np.array_equal(corpus.picture(1), taken)
    assert corpus.record(1)["sensor"]["name"] == "dslr"
