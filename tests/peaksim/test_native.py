"""The border between Python and C: declarations against the sources, what is refused, and what is said."""

import importlib
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from peaksim.native import DECLARED, Function

from tests.places import ROOT

COLUMNS = "i8 kept_rows(const f8[n,2] xy, const f8[n] sides, f8 apart, b1 by_larger, f8 like_size, i8[n] rows)"


def exported() -> set[str]:
    """Return the prototypes of what the C sources export to modules, each in one line."""
    text = "\n".join(path.read_text("utf-8") for path in sorted((ROOT / "native").glob("*_*.c")))
    return {" ".join(words.split()) for words in re.findall(r"^EXPORT ([^{]+)\{", text, re.MULTILINE)}


def declared() -> set[str]:
    """Return the prototypes of all kernels that a module declares."""
    for root in ("sim", "src"):
        for path in (ROOT / root).rglob("*.py"):
            if re.search(r"^from peaksim.native import", path.read_text("utf-8"), re.MULTILINE):
                importlib.import_module(".".join(path.relative_to(ROOT / root).with_suffix("").parts))
    return {kernel.prototype() for kernel in DECLARED}


def test_every_declaration_is_what_c_defines_and_nothing_else_is_exported() -> None:
    assert declared() == exported()


def test_every_source_serves_a_module() -> None:
    assert {path.stem for path in (ROOT / "native").glob("*.c") if "_" not in path.stem} == {"cpu", "elementary"}
    for path in (ROOT / "native").glob("*_*.c"):
        served = re.search(r"Serves ([\w/.]+\.py)", path.read_text("utf-8").partition("*/")[0])
        assert served, path.name
        assert any((ROOT / root / served[1]).is_file() for root in ("sim", "src")), path.name


def kept(*, xy: object = None, sides: object = None, rows: object = None) -> int:
    xy = np.zeros((3, 2)) if xy is None else xy
    sides, rows = np.ones(3) if sides is None else sides, np.empty(3, np.int64) if rows is None else rows
    count: int = Function(COLUMNS)(xy, sides, 0.6, True, np.inf, rows)
    return count


def test_what_is_read_may_have_any_layout_and_a_narrower_type() -> None:
    apart = np.arange(3)[:, None] * np.ones(2)
    assert kept() == 1
    assert kept(xy=apart) == kept(xy=np.asfortranarray(apart)) == kept(xy=apart.astype(np.float32)) == 3
    assert kept(xy=np.repeat(apart, 2, axis=0)[::2], sides=np.ones(3, np.int32)) == 3


def read_only(array: np.ndarray) -> np.ndarray:
    array.flags.writeable = False
    return array


@pytest.mark.parametrize(
    ("argument", "words"),
    [
        ({"xy": np.zeros((3, 3))}, "xy"),
        ({"xy": np.zeros(6)}, "xy: expected 2 axes"),
        ({"sides": np.ones(4)}, "sides"),
        ({"sides": np.ones(3, complex)}, "sides"),
        ({"sides": "abc"}, "sides"),
        ({"rows": np.empty(3, np.int32)}, "rows"),
        ({"rows": np.empty(6, np.int64)[::2]}, "rows"),
        ({"rows": np.empty(2, np.int64)}, "rows"),
        ({"rows": read_only(np.empty(3, np.int64))}, "rows"),
        ({"rows": [0, 0, 0]}, "rows"),
    ],
)
def test_what_is_not_as_declared_is_refused_by_name(argument: dict[str, object], words: str) -> None:
    with pytest.raises(TypeError, match=words):
        kept(**argument)


@pytest.mark.parametrize("text", ["kept_rows()", "i8 f(const f8[n] )", "i8 f(f3 x)", "float f(i8 x)", "i8 f(i8)"])
def test_a_declaration_that_says_nothing_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="kernel"):
        Function(text)


def test_a_prototype_has_each_length_once() -> None:
    kernel = Function("status f(const u1[h,w] image, f4[n,2]? xy, f4[n,h] rest, b1 on)")
    assert kernel.prototype() == (
        "status f(const uint8_t *image, int64_t h, int64_t w, float *xy, int64_t n, float *rest, bool on)"
    )


def test_sources_are_c_that_reads_alike_on_every_processor() -> None:
    """Functions of the C library whose last bits differ from one processor to the next are not called."""
    forbidden = r"(?<![\w.>])(exp|exp2|pow|log|log2|log10|sin|cos|tan|asin|acos|atan|atan2|cbrt|hypot|fma)f?\("
    for path in sorted(Path(ROOT / "native").glob("*.[ch]")):
        assert not re.findall(forbidden, path.read_text("utf-8")), path.name


@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler but the one that pip can bring")
def test_sources_compile_without_a_warning() -> None:
    flags = ["-std=c11", "-O2", "-Wall", "-Wextra", "-Wshadow", "-Werror", "-fsyntax-only"]
    subprocess.run(["cc", *flags, *sorted((ROOT / "native").glob("*.c"))], check=True)
