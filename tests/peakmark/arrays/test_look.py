"""What is seen where an array's markers should stand: the right pattern at its position, and nothing elsewhere."""

from typing import get_args

import numpy as np
import pytest

from peakmark.arrays.look import AROUND, look_around, template
from peakmark.markers.array_code import THREE_BIT, polarities_of
from peakmark.markers.patterns import Polarity
from tests.peakmark.arrays.arrays_scene import facing_wall
from tests.peakmark.arrays.rendered import paper, true_detections, view


@pytest.mark.parametrize(
    ("distance", "tilt", "direction", "roll"),
    [(0.5, 0, 0, 0), (0.7, 40, 70, 25), (0.6, 62, 200, 130), (1.0, 68, 10, 300)],
)
@pytest.mark.parametrize("code", [1, 6])
def test_every_member_sees_the_others_and_nothing_else(
    code: int, distance: float, tilt: float, direction: float, roll: float
) -> None:
    pose = facing_wall(distance, tilt, direction, roll)
    image, members = view(paper(code), pose), true_detections(code, pose)
    for member in members:
        assert member.affinity is not None
        sightings = look_around(image, member.xy, member.affinity, THREE_BIT.pitch)
        seen = [s for s in sightings.values() if s.probability > 0.5]
        others = [m for m in members if m is not member]
        assert len(seen) == 2
        for other in others:
            (sighting,) = (s for s in seen if np.linalg.norm(s.xy - other.xy) < 0.03 * other.size)
            assert sighting.polarity == other.polarity
            assert sighting.probability > 0.99
            assert sighting.side_px == pytest.approx(other.size, rel=0.1)
        assert max(s.probability for s in sightings.values() if s not in seen) < 0.01


def test_cells_outside_the_image_are_not_looked_at() -> None:
    image = np.full((60, 200), 200, np.uint8)
    around = look_around(image, np.array([100.0, 30.0]), 20 * np.eye(2), 1.5)
    assert set(around) == {cell for cell in AROUND if cell[1] == 0}
    assert max(s.probability for s in around.values()) < 0.01


def test_templates_are_the_printed_markers_on_white() -> None:
    for code in (0, 7):
        (polarity,) = set(polarities_of(code))
        (x,) = {d.polarity for d in true_detections(code, facing_wall(0.5, 0, 0, 0))}
        assert polarity == x
    for polarity in get_args(Polarity):
        levels = template(polarity)
        assert np.allclose(levels, levels.T, atol=1e-6)
        assert np.allclose(levels, levels[::-1], atol=1e-6)
        middle = len(levels) // 2
        assert levels[0, 0] > 0.95
        assert (levels[middle, middle] < 0.1) == (polarity == "dark")
