"""Kinds of markers side by side: equal frames but for the kind, and what is counted."""

from pathlib import Path

import numpy as np
import pytest

from peakmark.errors import InputError
from peakmark.experiments.cave.rooms import photographs
from peakmark.experiments.journal import Journal
from peakmark.experiments.search.kinds import KINDS, KindsConfig, compare_kinds
from peakmark.experiments.search.lit_images import plain_image
from peakmark.markers.patterns import Variant


def test_frames_differ_in_the_markers_alone() -> None:
    photos = photographs("held-out")
    one, other = (
        plain_image(
            np.random.default_rng(3),
            photos,
            (Variant("dark", "energy", made_for), Variant("light", "energy", made_for)),  # type: ignore[arg-type]
        )
        for made_for in ("surf", "sift")
    )
    assert [m.kind.replace("surf", "sift") for m in one.truth] == [m.kind for m in other.truth]
    assert np.array_equal([m.corners_xy for m in one.truth], [m.corners_xy for m in other.truth])
    assert 0 < (one.gray != other.gray).mean() < 0.8


@pytest.mark.slow
def test_each_kind_has_a_row(tmp_path: Path) -> None:
    rows = compare_kinds(KindsConfig(frames=1), Journal.open(tmp_path, {}))
    assert [(row["detector"], row["limit"]) for row in rows] == list(KINDS)
    assert len({row["wanted"] for row in rows}) == 1
    assert all(row["found"] > 0.6 * row["wanted"] for row in rows)


def test_numbers_out_of_range_are_named() -> None:
    with pytest.raises(InputError, match="--frames"):
        KindsConfig(frames=0)
