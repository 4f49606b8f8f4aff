"""Faulty TOML tables: each fault is named in the one line, and mistyped fields get a guess at any depth."""

from typing import Annotated, Literal

import pytest
from peaksim.errors import SceneError
from peaksim.scene.schema import StrictTable
from peaksim.toml_file import validate
from pydantic import Field


class Near(StrictTable):
    kind: Literal["near"]
    reach_m: float = 1.0


class Far(StrictTable):
    kind: Literal["far"]
    horizon_m: float = 9.0


class Inner(StrictTable):
    width_px: int = 1


class Outer(StrictTable):
    views: tuple[Annotated[Near | Far, Field(discriminator="kind")], ...] = ()
    sizes: dict[str, Inner] = Field(default_factory=dict)
    inner: Inner | None = None
    count: int = 3


def message(content: object) -> str:
    with pytest.raises(SceneError) as caught:
        validate(Outer, content, "f.toml")
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_every_fault_is_named() -> None:
    assert message({"count": "x", "cuont": 1, "inner": {"widht_px": 2, "depth": 3}}) == (
        "f.toml: inner.widht_px: unknown field (did you mean 'width_px'?); inner.depth: unknown field; "
        "cuont: unknown field (did you mean 'count'?); "
        "count: input should be a valid integer, unable to parse string as an integer, got 'x'"
    )


def test_many_faults_are_counted() -> None:
    said = message({f"{letter * 9}": 1 for letter in "abdefghjklmn"})
    assert said.count("unknown field") == 10
    assert said.endswith("; and 2 more")


@pytest.mark.parametrize(
    ("content", "guess"),
    [
        ({"views": [{"kind": "far", "horizn_m": 1}]}, "horizon_m"),
        ({"views": [{"kind": "near", "reach": 1}]}, "reach_m"),
        ({"sizes": {"a": {"width": 1}}}, "width_px"),
    ],
)
def test_the_guess_is_a_field_of_the_same_kind_of_table(content: object, guess: str) -> None:
    assert f"unknown field (did you mean {guess!r}?)" in message(content)


def test_a_field_of_another_kind_is_no_guess() -> None:
    assert message({"views": [{"kind": "near", "horizon_m": 1}]}).endswith("horizon_m: unknown field")
