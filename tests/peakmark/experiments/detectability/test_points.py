import pytest

from peakmark.errors import InputError
from peakmark.experiments.detectability.points import (
    EXPERIMENTS,
    OF_VLFEAT,
    PAPER_EXPERIMENTS,
    DetectabilityConfig,
    points,
)


def test_points_have_unique_names_and_every_thins_them():
    everything = points(DetectabilityConfig())
    assert len({point.name for point in everything}) == len(everything)
    assert {point.experiment for point in everything} == set(EXPERIMENTS)
    coarse = points(DetectabilityConfig(every=4))
    assert len(coarse) < len(everything) / 3
    assert {point.name for point in coarse} <= {point.name for point in everything}


def test_the_paper_has_one_centred_marker_a_point_along_its_own_axes():
    found = points(DetectabilityConfig(is_paper=True))
    assert {point.experiment for point in found} == set(PAPER_EXPERIMENTS)
    assert all(point.condition.is_centred and point.condition.image_px == 513 for point in found)


def test_every_axis_covers_what_it_should():
    spans = {
        ("scale", "surf-dark"): (8, 260),
        ("scale", "sift-dark"): (1, 60),
        ("turn", "surf-dark"): (0, 180),
        ("tilt", "sift-dark"): (0, 80),
        ("noise", "surf-dark"): (0, 100),
        ("jpeg", "sift-dark"): (2, 100),
    }
    for (experiment, marker), span in spans.items():
        values = [p.x for p in points(DetectabilityConfig(only=(experiment,))) if p.condition.marker == marker]
        assert (min(values), max(values)) == span
    tilts = {p.series for p in points(DetectabilityConfig(only=("tilt",))) if p.condition.marker == "surf-dark"}
    assert tilts == {"1 side away", "2 sides away", "5 sides away", "20 sides away"}


def test_thinned_sizes_keep_those_next_to_the_seams():
    sizes = {p.x for p in points(DetectabilityConfig(every=4, only=("scale",))) if p.condition.marker == "surf-dark"}
    assert {28, 54, 111} <= sizes
    sigmas = {p.x for p in points(DetectabilityConfig(every=4, only=("scale",))) if p.condition.marker == "sift-dark"}
    assert {8.54, 18.63} <= sigmas


def test_vlfeat_takes_part_where_it_is_installed(monkeypatch):
    def vlfeat_points(**settings):
        everything = points(DetectabilityConfig(**settings))
        return {(p.experiment, p.condition.marker) for p in everything if "vlfeat" in p.detectors}

    monkeypatch.setattr("peakmark.experiments.detectability.points.find_spec", lambda name: object())
    assert vlfeat_points() == {(name, "sift-dark") for name in OF_VLFEAT}
    assert vlfeat_points(is_paper=True) == {(name, "sift-dark") for name in PAPER_EXPERIMENTS}
    monkeypatch.setattr("peakmark.experiments.detectability.points.find_spec", lambda name: None)
    assert vlfeat_points() == set()


def test_further_detectors_get_every_point_once():
    for point in points(DetectabilityConfig(every=9, extra=("cv2:ORB", "sift"))):
        assert point.detectors.count("cv2:ORB") == point.detectors.count("sift") == 1


@pytest.mark.parametrize(
    "changes", [{"trials": 0}, {"every": 0}, {"seed": -1}, {"only": ("luck",)}, {"extra": ("orb",)}]
)
def test_bad_configurations_are_refused(changes):
    with pytest.raises(InputError, match=r"expected .* got "):
        DetectabilityConfig(**changes)
