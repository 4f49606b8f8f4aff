"""Why nothing was found: what is wrong with the image, or which other kind of marker is in it."""

import numpy as np
import pytest

from peakmark import find, why_nothing
from peakmark.errors import InputError
from peakmark.markers.optimum import Limit
from peakmark.markers.patterns import Made, Variant, marker_image
from tests.helpers import marker_view


def test_it_names_what_is_wrong_with_the_image() -> None:
    assert "pixel are 0 grey levels apart" in why_nothing(np.full((200, 200), 90, np.uint8))
    assert "the image has 8×8 px" in why_nothing(np.zeros((8, 8), np.uint8))


def test_of_what_is_no_marker_the_likeliest_is_named() -> None:
    part = marker_view(60)
    part[:, 116:] = 255
    assert not find(part).markers
    assert "has a probability of 0." in why_nothing(part)


@pytest.mark.parametrize("made_for", ["surf", "sift"])
@pytest.mark.parametrize("limit", ["energy", "range"])
def test_another_kind_is_named_with_what_to_ask_for(made_for: Made, limit: Limit) -> None:
    image = np.full((256, 256), 255, np.uint8)
    image[60:160, 80:180] = marker_image(100, Variant("dark", limit, made_for))
    asked = "sift" if made_for == "surf" else "surf"
    reason = why_nothing(image, asked)
    assert reason.startswith(
        f"looked for dark and light {asked.upper()} markers of at least 12 px a side; another kind"
    )
    assert f"ask for detector {made_for}, limit {limit}" in reason
    ((x, y),) = [marker.xy for marker in find(image, detector=made_for, limit=limit).markers]
    assert f"at ({x:.0f}, {y:.0f})" in reason


def test_an_unknown_detector_is_refused() -> None:
    with pytest.raises(InputError, match="detector: expected one of"):
        why_nothing(np.zeros((64, 64), np.uint8), "orb")
