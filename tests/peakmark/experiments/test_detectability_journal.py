import pytest

from peakmark.errors import InputError
from peakmark.experiments.detectability_journal import Journal
from peakmark.experiments.detectability_points import Config

CONFIG = Config(trials=2)


def reopened(path, config=CONFIG):
    journal = Journal(path, config)
    journal.open()
    return journal.rows


def test_what_is_added_is_there_when_opened_again(tmp_path):
    journal = Journal(tmp_path / "new" / "points.jsonl", CONFIG)
    journal.open()
    journal.add("a", [{"x": 1.5, "text": "σ"}])
    journal.add("b", [])
    assert reopened(journal.path) == journal.rows == {"a": [{"x": 1.5, "text": "σ"}], "b": []}


def test_half_a_line_of_a_killed_run_costs_that_point_alone(tmp_path):
    journal = Journal(tmp_path / "points.jsonl", CONFIG)
    journal.open()
    journal.add("a", [{"x": 1}])
    journal.add("b", [{"x": 2}])
    text = journal.path.read_text()
    journal.path.write_text(text[:-9])
    again = Journal(journal.path, CONFIG)
    again.open()
    assert again.rows == {"a": [{"x": 1}]}
    again.add("c", [{"x": 3}])
    assert reopened(journal.path) == {"a": [{"x": 1}], "c": [{"x": 3}]}


def test_a_run_of_another_configuration_is_not_mixed_in(tmp_path):
    Journal(tmp_path / "points.jsonl", CONFIG).open()
    for other in (Config(trials=3), Config(trials=2, seed=1), Config(trials=2, is_paper=True)):
        with pytest.raises(InputError, match=r"expected a run of .* found one of "):
            reopened(tmp_path / "points.jsonl", other)
    assert reopened(tmp_path / "points.jsonl", Config(trials=2, every=3, only=("turn",))) == {}


def test_a_place_that_cannot_be_written_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="expected a file that can be written"):
        reopened(tmp_path / "file" / "points.jsonl")
