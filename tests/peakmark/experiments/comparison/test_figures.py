"""Figures and who wins: the rule itself, counts by set and value, and pages that say what data.json says."""

import json
from dataclasses import replace
from html import unescape
from pathlib import Path

import pytest

from peakmark.experiments.comparison import results
from peakmark.experiments.comparison.boards import TruePrint
from peakmark.experiments.comparison.comparison import Frame, Measured
from peakmark.experiments.comparison.figures import ComparisonFigures, Figure, Topic, best_of, figures_of
from peakmark.experiments.comparison.measure import FrameOutcome, PoseOutcome, ReaderOutcome
from peakmark.experiments.comparison.own_images import prints_of
from peakmark.experiments.comparison.readers import READERS
from peakmark.experiments.images.truth import TrueImage, TrueMarker, TrueTag
from peakmark.plain import from_plain, to_plain


def figure(reader: str, value: float | None, low: float | None, high: float | None) -> Figure:
    return Figure(reader, value, low, high, 100)


@pytest.mark.parametrize(
    ("figures", "larger", "best"),
    [
        ([figure("identify", 0.9, 0.85, 0.95), figure("AprilTag-C", 0.5, 0.4, 0.6)], True, ("identify",)),
        ([figure("identify", 0.9, 0.85, 0.95), figure("AprilTag-C", 0.5, 0.4, 0.6)], False, ("AprilTag-C",)),
        ([figure("identify", 0.90, 0.85, 0.95), figure("ringgrid", 0.92, 0.86, 0.96)], True, ("ringgrid", "identify")),
        ([figure("chess-corners", 1.0, 0.9, 1.0), figure("identify", 0.5, 0.4, 0.6)], True, ("identify",)),
        ([figure("ringgrid", None, None, None), figure("identify", 0.1, 0.05, 0.2)], True, ("identify",)),
        ([replace(figure("ringgrid", 1.0, 1.0, 1.0), of=9), figure("identify", 0.5, 0.4, 0.6)], True, ("identify",)),
        ([], True, ()),
    ],
)
def test_the_best_wins_with_all_that_reach_into_its_interval(
    figures: list[Figure], larger: bool, best: tuple[str, ...]
) -> None:
    assert best_of(figures, larger) == best


def outcome(errors: tuple[float | None, ...], false: int = 0) -> FrameOutcome:
    pose = PoseOutcome(0.001, 0.1, True)
    readers = tuple(ReaderOutcome(reader.name, errors, false, 0.01, pose) for reader in READERS)
    return FrameOutcome((TruePrint("marker", 0, (1.0, 2.0), 30.0, 10.0),), readers)


@pytest.fixture
def figures() -> ComparisonFigures:
    measured = [
        Measured(Frame("clean", "noise", 10.0, 0), outcome((0.1, None))),
        Measured(Frame("clean", "noise", 10.0, 1), outcome((0.2, 0.3))),
        Measured(Frame("warped", number=0), outcome((0.1, 0.1, 0.1))),
        Measured(Frame("bare", number=0), outcome((), 1)),
    ]
    return figures_of(measured, "peakmark compare", 0)


def test_figures_count_prints_frames_and_poses(figures: ComparisonFigures) -> None:
    def one(set_name: str, what: str, value: float | None = None) -> Figure:
        (line,) = [x for x in figures.lines if (x.set, x.what, x.value) == (set_name, what, value)]
        return line.readers[0]

    assert (one("clean", "recall").value, one("clean", "recall").of) == (0.75, 4)
    assert one("clean", "recall", 10.0).value == 0.75
    assert one("clean", "error_p50").value == 0.2
    assert one("bare", "false").value == 1
    assert one("clean", "false").value == 0
    assert (one("warped", "inside").value, one("warped", "position_p50").value) == (1, pytest.approx(1.0))
    assert [name for name, _ in figures.frames] == ["clean", "warped", "bare"]
    topics = {topic.name: topic for topic in figures.topics}
    assert {"noise", "warped", "false", "centre", "processor"} <= topics.keys()
    assert "folder" not in topics
    assert topics["noise"].readers[0].of == 4


def test_the_pages_say_what_the_data_say(figures: ComparisonFigures, tmp_path: Path) -> None:
    results.write_comparison(figures, tmp_path)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["data.json", "index.md", "rates.png", "report.html"]
    read = from_plain(ComparisonFigures, json.loads((tmp_path / "data.json").read_text("utf-8")))
    assert to_plain(read) == to_plain(figures)
    assert (tmp_path / "index.md").read_text("utf-8") == results.markdown(read)
    page = unescape((tmp_path / "report.html").read_text("utf-8"))
    for topic in figures.topics:
        assert topic.question in page


def test_prints_of_a_folder_count_where_they_are_whole_flat_and_large() -> None:
    markers = [
        TrueMarker(polarity="light", xy=(10.0 + 20 * k, 50.0), side_px=30, tilt_deg=5, visible=v, group="a", code=3)
        for k, v in enumerate((1.0, 1.0, 0.8))
    ]
    tag = TrueTag(id=7, xy=(5.0, 6.0), side_px=10)
    found = prints_of(TrueImage(file="a.png", markers=tuple(markers), tags=(tag,)))
    assert [(one.design, one.code, one.is_whole) for one in found] == [
        ("marker", 1, True),
        ("marker", 1, True),
        ("marker", 1, False),
        ("array", 3, False),
        ("AprilTag 36h11", 7, False),
    ]


def test_who_wins_is_said_in_words(figures: ComparisonFigures) -> None:
    def topic(*best: str) -> Topic:
        return Topic(f"won by {best}", "q", "%", True, (figure("identify", 0.9, 0.8, 1.0),), best)

    topics = (topic("identify"), topic("AprilTag-C", "identify SIFT"), topic("ringgrid"), topic())
    assert [row[1] for row in results.verdict_rows(replace(figures, topics=topics))] == [
        "peakmark",
        "level",
        "others",
        "–",
    ]
    assert [text for _, text in results.in_short(replace(figures, topics=topics))] == ["q", "q", "q"]
    assert results.honesty_rows(figures) is not None
    assert results.honesty_rows(replace(figures, lines=())) is None
