from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from peaksim import render
from peaksim.scene.file import load_scene

from peakmark.errors import InputError
from peakmark.experiments.drawing import Drawing


def test_a_frame_is_what_the_renderer_draws_with_these_settings() -> None:
    setup = load_scene("floor")
    camera, pose = replace(setup.camera, width=24, height=18), setup.trajectory.at(0.0)
    seen = Drawing(renderer="exact").frame(setup.scene, camera, pose, 0.5, (3, 1))
    assert (seen.renderer, seen.time_s) == ("exact", 0.5)
    assert np.array_equal(seen.image, render(setup.scene, camera, pose, "exact").image)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"seed": -1}, "--seed: expected 0 or more, got -1"),
        ({"renderer": "ray"}, "--renderer: expected auto, exact, gl, pyrender or traced, got ray"),
        ({"samples": 0}, "--samples: expected 1 or more, got 0"),
    ],
)
def test_bad_input_is_one_line(change: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        Drawing(**change)
