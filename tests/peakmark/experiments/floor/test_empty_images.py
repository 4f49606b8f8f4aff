"""Images without markers: what they are, and how detections in them are counted."""

import numpy as np
import pytest

from peakmark.experiments.floor.empty_images import (
    WIDTHS_PX,
    EmptyImage,
    bare_floors,
    count_false_positives,
    photographs,
)
from peakmark.plain import to_plain
from peakmark.score.statistics import rate
from tests.helpers import marker_view


def test_images_without_markers_give_no_detection() -> None:
    photos, bare = count_false_positives(photographs((240,))), count_false_positives(bare_floors(1))
    assert photos.images == bare.images == []
    assert photos.without == {"photograph": rate(36, 36)}
    assert bare.without == {"rendered": rate(3, 3)}


def test_a_detection_is_counted_and_named() -> None:
    plain = np.full((100, 100), 128, np.uint8)
    images = [EmptyImage("none", "rendered", plain, 1.0), EmptyImage("one", "rendered", marker_view(60), 1.0)]
    found = count_false_positives(images)
    assert found.images == ["one: 1"]
    assert found.without == {"rendered": rate(1, 2)}
    assert to_plain(found) == {"loud": ["one: 1"], "rendered": to_plain(rate(1, 2))}


@pytest.mark.parametrize("width", WIDTHS_PX[:2])
def test_photographs_have_the_widths_asked_for(width: int) -> None:
    assert {image.gray.shape[1] for image in photographs((width,))} == {width}
