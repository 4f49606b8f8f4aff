"""Cameras by name: geometry stays, the same seed gives the same image, scene files and pages name them."""

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from peaksim import load_scene
from peaksim.camera import Sensor, capture_image, sensor_named
from peaksim.camera.presets import PRESETS
from peaksim.errors import SceneError

from tests.peaksim.camera.blobs import blobs, centroids
from tests.places import ROOT

QUIET = {"full_well_e": 0.0, "read_noise": 0.0, "hot_pixels": 0.0, "jpeg_quality": 0, "bits": 16}
CENTERS = np.array([(60 + 130 * (k % 5), 60 + 120 * (k // 5)) for k in range(20)]) + np.random.default_rng(3).uniform(
    -0.5, 0.5, (20, 2)
)


@pytest.mark.parametrize("name", PRESETS)
def test_blobs_stay_where_they_are(name: str) -> None:
    """Within 0.01 px anywhere in the image, through blur, aberration, mosaic, curve and sharpening, without noise."""
    sensor = sensor_named(name, vignetting=0.0, **QUIET)  # a falloff is a ramp of light, which moves a centroid
    image = capture_image(blobs((480, 640), CENTERS), sensor, np.random.default_rng(0))
    assert np.abs(centroids(image, CENTERS) - CENTERS).max() < 0.01


@pytest.mark.parametrize("name", PRESETS)
def test_noise_is_unbiased_and_jpeg_moves_nothing(name: str) -> None:
    sensor = sensor_named(name, vignetting=0.0, hot_pixels=0.0)
    light = blobs((480, 640), CENTERS)
    errors = [
        centroids(capture_image(light, sensor, np.random.default_rng((0, frame))), CENTERS) - CENTERS
        for frame in range(6)
    ]
    spread = np.std(errors) / np.sqrt(np.size(errors) / 2)
    assert np.abs(np.mean(errors, axis=(0, 1))).max() < 0.01 + 3 * spread


@pytest.mark.parametrize("name", PRESETS)
def test_the_same_frame_of_the_same_seed_is_the_same_image(name: str) -> None:
    light = np.random.default_rng(0).uniform(0, 255, (48, 64, 3)).astype(np.float32)
    first, again, other = (
        capture_image(light, PRESETS[name], np.random.default_rng((5, frame))) for frame in (7, 7, 8)
    )
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def test_a_preset_is_named_in_scene_files_and_its_fields_can_be_changed(tmp_path: Path) -> None:
    scene = tmp_path / "scene.toml"
    scene.write_text(
        """
        [camera]
        width = 64
        height = 48
        fx = 50.0
        [[trajectory]]
        eye_m = [0, 0, 1]
        target_m = [1, 0, 1]
        [sensor]
        preset = "phone"
        bits = 12
        jpeg_quality = 0
        tone = [[0, 0], [0.3, 0.6], [1, 1]]
        """,
        encoding="utf-8",
    )
    expected = replace(PRESETS["phone"], bits=12, jpeg_quality=0, tone=((0, 0), (0.3, 0.6), (1, 1)))
    assert load_scene(scene).sensor == expected
    scene.write_text(scene.read_text(encoding="utf-8").replace("phone", "telephone"), encoding="utf-8")
    with pytest.raises(SceneError, match=rf"^{scene}: sensor\.preset: expected one of machine.*, got 'telephone'$"):
        load_scene(scene)


def test_the_page_of_sensors_states_the_figures_of_each() -> None:
    page = (ROOT / "docs/reference/sensors.md").read_text(encoding="utf-8")
    rows = [
        [cell.strip() for cell in line.strip("|").split("|")] for line in page.splitlines() if line.startswith("| ")
    ]
    head = next(row for row in rows if row[0] == "field")
    stated = {row[0].strip("`"): dict(zip(head[1:], row[1:], strict=True)) for row in rows if len(row) == len(head)}
    for name, sensor in PRESETS.items():
        for field in fields(Sensor):
            value = getattr(sensor, field.name)
            if field.name != "name" and value != field.default:
                assert stated[field.name][f"`{name}`"] == (value if isinstance(value, str) else f"{value:g}"), (
                    field.name
                )
        for field_name, cells in stated.items():
            if field_name in Sensor.__dataclass_fields__ and cells[f"`{name}`"] == "–":
                assert getattr(sensor, field_name) == getattr(Sensor(), field_name)
        assert (ROOT / f"docs/images/sensor_{name}.jpg").is_file()
