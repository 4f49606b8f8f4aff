"""Kinds of markers side by side: equal frames but for the kind, and what is counted."""

from pathlib import Path

import numpy as np
import pytest

from peakmark.errors import InputError
from peakmark.experiments.cave.rooms import photographs
from peakmark.experiments.journal import Journal
from peakmark.experiments.search.kinds import KINDS, KindsConfig, compare_kinds, faults
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
def test_each_place_and_kind_has_a_row(tmp_path: Path) -> None:
    config, journal = KindsConfig(frames=1, places=("sheets", "floors")), Journal.open(tmp_path, {})
    rows = compare_kinds(config, journal)
    assert [(row["place"], row["detector"], row["limit"]) for row in rows] == [
        (place, *kind) for place in config.places for kind in KINDS
    ]
    for place in config.places:
        (wanted,) = {row["wanted"] for row in rows if row["place"] == place}
        assert all(row["found"] > 0.6 * wanted for row in rows if row["place"] == place)
    assert all(sum(group["of"] for group in row["groups"]["side_px"]) == row["wanted"] for row in rows)
    missed = sum(len(fault["missed"]) for fault in faults(config, journal))
    assert missed == sum(row["wanted"] - row["found"] for row in rows)


def test_numbers_out_of_range_are_named() -> None:
    with pytest.raises(InputError, match="--frames"):
        KindsConfig(frames=0)
    with pytest.raises(InputError, match="--place: expected sheets, floors or rooms, got walls"):
        KindsConfig(places=("walls",))  # type: ignore[arg-type]
    with pytest.raises(InputError, match="--place"):
        KindsConfig(places=())
