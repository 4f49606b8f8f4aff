"""Views on disk: the first one's images and figures, a film of all, and curves with gaps."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import av
import numpy as np
import pytest
from peaksim import Camera, Scene, render
from peaksim.camera.frame import Frame
from PIL import Image

from peakmark.report import plots
from peakmark.report.views import curve_section, write_views


@dataclass(frozen=True)
class Numbered:
    frame: Frame
    number: int


def views(count: int) -> Iterator[Numbered]:
    camera = Camera(64, 48, 50.0, 50.0, 31.5, 23.5)
    for number in range(count):
        yield Numbered(render(Scene(quads=(), background=20 * number), camera, np.eye(4), renderer="exact"), number)


@pytest.mark.parametrize("film", [None, "film.mp4"])
def test_the_first_view_has_images_and_all_are_counted(tmp_path: Path, film: str | None) -> None:
    numbers: list[int] = []
    first, uris = write_views(
        tmp_path,
        views(3),
        overlay=lambda view: np.full((48, 64, 3), 100 + view.number, np.uint8),
        figures=lambda view: {"curve": plots.new_figure()[0]},
        film=film,
        on_view=lambda view: numbers.append(view.number),
    )
    assert (first.number, numbers) == (0, [0, 1, 2])
    assert list(uris) == ["overlay", "curve"]
    assert {p.name for p in tmp_path.iterdir()} == {"frame.png", "overlay.png", "curve.png"} | ({film} - {None})
    assert np.array_equal(np.asarray(Image.open(tmp_path / "frame.png")), first.frame.image)
    assert (np.asarray(Image.open(tmp_path / "overlay.png")) == 100).all()
    if film is not None:
        with av.open(str(tmp_path / film)) as container:
            assert sum(1 for _ in container.decode(video=0)) == 3


def test_a_curve_may_have_gaps() -> None:
    section = curve_section("drop", "ratio", [0.0, 1.0, 2.0], [1.0, None, 2.0])
    assert section.title == "Over time: drop"
    assert section.image.startswith("data:image/svg+xml")
