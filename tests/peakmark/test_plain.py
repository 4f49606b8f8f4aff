"""Records as plain values: to JSON and back they are equal, arrays, nan, options and nested records included."""

import json
from dataclasses import dataclass, field

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from peakmark.plain import INLINED, from_plain, to_plain
from peakmark.score.statistics import quantiles, rate


@dataclass(frozen=True)
class Point:
    xy: NDArray[np.float64]
    name: str | None


@dataclass(frozen=True)
class Line:
    points: tuple[Point, ...]
    ends: tuple[int, float]
    weights: NDArray[np.intp] | None
    times: dict[str, float]


POINTS = st.builds(
    Point, st.lists(st.floats(), min_size=2, max_size=2).map(lambda xy: np.array(xy)), st.none() | st.text()
)
LINES = st.builds(
    Line,
    st.lists(POINTS).map(tuple),
    st.tuples(st.integers(), st.floats(allow_nan=False)),
    st.none() | st.lists(st.integers(0, 9)).map(lambda values: np.array(values, dtype=np.intp)),
    st.dictionaries(st.text(), st.floats(allow_nan=False)),
)


@given(LINES)
def test_a_record_is_itself_after_json(line: Line) -> None:
    again = from_plain(Line, json.loads(json.dumps(to_plain(line))))
    assert (again.ends, again.times) == (line.ends, line.times)
    assert [point.name for point in again.points] == [point.name for point in line.points]
    for point, before in zip(again.points, line.points, strict=True):
        np.testing.assert_array_equal(point.xy, before.xy)
    assert (again.weights is None) == (line.weights is None)
    if again.weights is not None and line.weights is not None:
        assert again.weights.dtype == np.intp
        np.testing.assert_array_equal(again.weights, line.weights)


def test_what_has_a_to_plain_of_its_own_says_what_it_is() -> None:
    sample = quantiles([1.0, 2.0])
    assert to_plain({"a": [sample, rate(1, 2)]}) == {
        "a": [sample.to_plain(), {"value": 0.5, "low": rate(1, 2).low, "high": rate(1, 2).high, "of": 2}]
    }


def test_numbers_of_numpy_become_numbers() -> None:
    assert json.dumps(to_plain((np.float32(1.5), np.int64(2), np.bool_(True)))) == "[1.5, 2, true]"


@dataclass(frozen=True)
class Named:
    number: int
    line: Line = field(metadata=INLINED)
    name: str


def test_the_fields_of_an_inlined_field_take_its_place() -> None:
    named = Named(3, Line((), (1, 2.0), None, {"a": 1.0}), "x")
    plain = to_plain(named)
    assert list(plain.items()) == [
        *(("number", 3), ("points", []), ("ends", [1, 2.0]), ("weights", None), ("times", {"a": 1.0}), ("name", "x"))
    ]
    assert from_plain(Named, plain) == named
