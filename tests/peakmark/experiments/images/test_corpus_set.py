"""A corpus of peaksim as a set of images."""

from pathlib import Path

import numpy as np
import pytest
from peaksim.corpus import make_corpus, open_corpus

from peakmark.errors import InputError
from peakmark.experiments.images.truth import Sought, read_set
from tests.peaksim.corpus.helpers import tiny_spec, write_tiny_scene


def test_a_corpus_is_read_with_its_records(tmp_path: Path) -> None:
    make_corpus(tiny_spec(frames=3), write_tiny_scene(tmp_path / "specs"), str(tmp_path / "c"))
    corpus, known = open_corpus(str(tmp_path / "c")), read_set(tmp_path / "c")
    assert len(known.images) == len(corpus) == 3
    assert any(image.markers for image in known.images)
    for number, (image, record) in enumerate(zip(known.images, corpus.records(), strict=True)):
        assert image.sensor == record["camera"]["name"]
        seen = [m for m in record["markers"] if m["visible_fraction"] > 0 and None not in m["points_xy"][0]]
        assert {m.xy for m in image.markers} <= {tuple(m["points_xy"][0]) for m in seen}
        assert np.array_equal(known.read(number), corpus.picture(number))


def test_only_markers_that_are_looked_for_count(tmp_path: Path) -> None:
    make_corpus(tiny_spec(frames=2), write_tiny_scene(tmp_path / "specs"), str(tmp_path / "c"))
    assert any(image.markers for image in read_set(tmp_path / "c").images)
    assert not any(image.markers for image in read_set(tmp_path / "c", Sought("sift")).images)


@pytest.mark.parametrize(
    ("sought", "kinds"),
    [
        (Sought(), {"surf-dark"}),
        (Sought(limit="both"), {"surf-dark", "surf-range-light"}),
        (Sought("sift"), {"sift-light"}),
        (Sought("sift", "range"), {"sift-range-dark"}),
        (Sought("surf-disc"), {"sift-range-dark"}),
    ],
)
def test_kinds_that_are_looked_for(sought: Sought, kinds: set[str]) -> None:
    known = ("surf-dark", "surf-range-light", "sift-light", "sift-range-dark", "own.png")
    assert {kind for kind in known if sought.includes(kind)} == kinds


def test_what_is_looked_for_is_checked() -> None:
    with pytest.raises(InputError, match="--detector: expected surf, sift, vlfeat or surf-disc, got orb"):
        Sought("orb")
    with pytest.raises(InputError, match="--limit"):
        Sought("sift", "none")  # type: ignore[arg-type]
