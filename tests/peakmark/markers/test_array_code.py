"""Codes and polarities: a bijection in the paper's order of bits, with and without parity."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from peakmark.errors import InputError
from peakmark.markers.array_code import THREE_BIT, Layout, code_of, polarities_of

LAYOUTS = st.builds(Layout, st.integers(2, 6), st.integers(2, 6), st.just(1.5), st.booleans())


def test_the_three_bits_are_upper_right_lower_left_lower_right() -> None:
    assert THREE_BIT.cells == ((1, 0), (0, 1), (1, 1))
    assert polarities_of(0) == ("dark", "dark", "dark")
    assert polarities_of(4) == ("light", "dark", "dark")
    assert polarities_of(2) == ("dark", "light", "dark")
    assert polarities_of(1) == ("dark", "dark", "light")


@given(LAYOUTS, st.data())
def test_codes_come_back(layout: Layout, data: st.DataObject) -> None:
    code = data.draw(st.integers(0, 2**layout.bits - 1))
    assert code_of(polarities_of(code, layout), layout) == code


@given(st.integers(2, 4), st.data())
def test_parity_finds_any_single_error(side: int, data: st.DataObject) -> None:
    layout = Layout(side, side, parity=True)
    polarities = list(polarities_of(data.draw(st.integers(0, 2**layout.bits - 1)), layout))
    assert polarities.count("light") % 2 == 0
    wrong = data.draw(st.integers(0, len(polarities) - 1))
    polarities[wrong] = "light" if polarities[wrong] == "dark" else "dark"
    assert code_of(polarities, layout) is None


@pytest.mark.parametrize("code", [-1, 8, True, 1.0])
def test_codes_out_of_range(code: int) -> None:
    with pytest.raises(InputError, match=r"expected an integer in 0…7"):
        polarities_of(code)


def test_bad_layouts() -> None:
    for bad in ({"rows": 1}, {"columns": 17}, {"rows": 2.5}, {"pitch": 1.0}, {"pitch": float("nan")}):
        with pytest.raises(InputError, match=f"layout: {next(iter(bad))}"):
            Layout(**bad)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="expected 3, got 2"):
        code_of(["dark", "light"])
