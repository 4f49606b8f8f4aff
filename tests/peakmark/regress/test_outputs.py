"""A comparison for machines and people: JUnit XML that parses, Markdown that shows names as they are, plain JSON."""

import json
from dataclasses import replace
from xml.etree import ElementTree

import pytest

from peakmark.regress.compare import Comparison, compare_records
from peakmark.regress.outputs import escaped, junit_xml, markdown, plain, sentence
from tests.peakmark.regress.helpers import frame, marker, missed, record, sound

EVIL = '<script>alert("1")</script> | [x](javascript:1) `'


@pytest.fixture
def worse() -> Comparison:
    after = record(*(frame(i, missed(), marker(90.0, side=60.0)) for i in range(20)))
    return compare_records(
        replace(after, suite=EVIL, detector=replace(after.detector, name=EVIL)), replace(sound(), suite=EVIL)
    )


def test_junit_has_a_case_a_metric_and_a_failure_a_fault(worse: Comparison) -> None:
    root = ElementTree.fromstring(junit_xml(worse))
    (suite,) = root
    assert root.tag == "testsuites"
    assert int(suite.attrib["tests"]) == len(list(suite)) == len(worse.changes)
    assert int(suite.attrib["failures"]) == len(suite.findall("testcase/failure")) == len(worse.faults) > 0
    assert int(suite.attrib["skipped"]) == len(suite.findall("testcase/skipped")) > 0
    failure = suite.find("testcase[@name='recall']/failure")
    assert failure is not None
    assert failure.attrib["type"] == "worse"
    assert "1 → 0.5" in failure.attrib["message"]


@pytest.mark.parametrize("text", ["\x1b[2J\x07bell", "\x00", "\x9b1m", "\u202eevil", "\ufffe", "two\nlines"])
def test_control_characters_of_a_record_stay_out_of_what_is_written(text: str) -> None:
    made = replace(sound(), suite=text, detector=replace(sound().detector, name=text))
    comparison = compare_records(made, made)
    (suite,) = ElementTree.fromstring(junit_xml(comparison))
    for written in (suite.attrib["name"], suite[0].attrib["classname"], *markdown(comparison).splitlines()):
        assert written.isprintable()


def test_markdown_has_a_row_a_metric_and_shows_evil_names_as_they_are(worse: Comparison) -> None:
    text = markdown(worse)
    assert text.count("\n| ") == len(worse.changes) + 1
    assert "<" not in text
    assert "[x]" not in text
    assert "&#91;x](javascript:1)" in text
    assert "▼ | recall" in text


def test_markdown_of_no_regression_says_so() -> None:
    assert markdown(compare_records(sound(), sound())).startswith("## made-up: no regression\n")


def test_a_sentence_says_figure_change_tolerance_and_frames(worse: Comparison) -> None:
    (recall,) = (c for c in worse.faults if c.metric.key == "recall")
    assert sentence(recall) == "recall: 1 → 0.5 (-0.5 [-0.5, -0.5], tolerance 0.01): worse; see frames 0, 1, 2"


def test_plain_values_are_json_without_infinity(worse: Comparison) -> None:
    values = json.loads(json.dumps(plain(worse), allow_nan=False))
    assert values["regression"] is True
    assert len(values["changes"]) == len(worse.changes)


def test_escaped_text_is_one_line() -> None:
    assert escaped("a\n<b> | [c] `d` & e") == "a &#60;b&#62; &#124; &#91;c] &#96;d&#96; &amp; e"
