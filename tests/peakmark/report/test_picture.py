"""Pictures for notebooks: a PNG of the image with what was found in it."""

from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from peaksim import Camera, Scene, render
from PIL import Image

from peakmark import find, overlay
from tests.helpers import marker_view


def test_a_notebook_gets_a_png_of_what_was_found(tmp_path: Path) -> None:
    image = marker_view(60)
    shown = overlay(image, find(image))
    assert np.array_equal(np.asarray(Image.open(BytesIO(shown._repr_png_()))), shown.pixels)
    drawn = (shown.pixels != image[..., None]).any(axis=2)
    assert drawn[90:167, 90:167].sum() == drawn.sum() > 100
    assert np.array_equal(overlay(image, find(image).markers).pixels, shown.pixels)
    shown.save(tmp_path / "a.png")
    assert np.array_equal(np.asarray(Image.open(tmp_path / "a.png")), shown.pixels)


def test_a_frame_is_shown_as_it_is() -> None:
    frame = render(Scene(()), Camera(32, 24, 30.0), np.eye(4), renderer="exact")
    assert np.array_equal(overlay(frame).pixels, np.dstack([frame.image] * 3))
    assert np.array_equal(np.asarray(Image.open(BytesIO(frame._repr_png_()))), frame.image)


def test_images_open_in_the_systems_viewer(monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[tuple[int, int]] = []
    monkeypatch.setattr(Image.Image, "show", lambda image: shown.append(image.size))
    frame = render(Scene(()), Camera(32, 24, 30.0), np.eye(4), renderer="exact")
    frame.show()
    overlay(frame).show()
    assert shown == [(32, 24), (32, 24)]
