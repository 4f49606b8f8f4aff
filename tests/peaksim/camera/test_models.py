"""Cameras by name see what their makers say."""

import numpy as np
import pytest
from peaksim import camera_named
from peaksim.camera.models import MODELS
from peaksim.errors import SceneError

DIAGONAL_35MM = np.hypot(36, 24)


@pytest.mark.parametrize(("name", "equivalent_mm"), [("panasonic-dmc-fx1", 35), ("sony-dsc-s85", 34)])
def test_the_field_of_view_is_the_35_mm_equivalent(name: str, equivalent_mm: float) -> None:
    camera = camera_named(name)
    diagonal_px = np.hypot(camera.width, camera.height)
    assert camera.fx / diagonal_px == pytest.approx(equivalent_mm / DIAGONAL_35MM, rel=0.02)
    assert (camera.cx, camera.cy) == ((camera.width - 1) / 2, (camera.height - 1) / 2)


def test_zooming_in_lengthens_the_focal_length() -> None:
    assert camera_named("sony-dsc-s85", 21.0).fx == pytest.approx(3 * camera_named("sony-dsc-s85").fx)


def test_an_unknown_name_is_refused_with_the_known_ones() -> None:
    with pytest.raises(SceneError, match=" ".join(list(MODELS)[:1])):
        camera_named("box brownie")
