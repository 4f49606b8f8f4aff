"""Suites: those that ship are sound, changes of the detector are no changes of the suite, files say what is wrong."""

from pathlib import Path

import pytest
from peaksim.corpus import load_spec
from peaksim.corpus.check_spec import check_spec

from peakmark.errors import InputError
from peakmark.regress.suite import Suite, load_suite

MINIMAL = """
name = "mine"
[corpus]
name = "mine"
frames = 10
[[corpus.scenes]]
file = "floor"
[[corpus.views]]
kind = "flight"
"""


def suite_of(folder: Path, text: str = MINIMAL) -> Suite:
    file = folder / "it's mine.toml"
    file.write_text(text, encoding="utf-8")
    return load_suite(str(file))


@pytest.mark.parametrize("name", ["floor", "cave"])
def test_the_suites_that_ship_are_sound(name: str) -> None:
    suite = load_suite(name)
    check_spec(suite.table.corpus, suite.folder)
    assert suite.table.name == name
    assert len(suite.frames(quick=True)) == suite.table.quick_frames < len(suite.frames(quick=False))


def test_quick_frames_are_even_steps_from_first_to_last(tmp_path: Path) -> None:
    suite = suite_of(tmp_path, "quick_frames = 4\n" + MINIMAL)
    assert suite.frames(quick=True) == (0, 3, 6, 9)
    assert suite.frames(quick=False) == tuple(range(10))


def test_the_detector_and_tolerances_are_no_part_of_what_a_baseline_must_match(tmp_path: Path) -> None:
    plain = suite_of(tmp_path).sha256
    assert suite_of(tmp_path, MINIMAL + "[detector]\nname = 'sift'\n[tolerances]\nrecall = 0.3\n").sha256 == plain
    assert suite_of(tmp_path, "min_side_px = 20\n" + MINIMAL).sha256 != plain
    assert suite_of(tmp_path, MINIMAL.replace("frames = 10", "frames = 11")).sha256 != plain


def test_the_suites_parameters_are_for_its_own_detector(tmp_path: Path) -> None:
    suite = suite_of(tmp_path, MINIMAL + "[detector]\nname = 'surf'\nparameters = { threshold = 50 }\n")
    assert suite.detector().parameters == {"threshold": 50}
    assert suite.detector(parameters={"octaves": 3}).parameters == {"threshold": 50, "octaves": 3}
    assert suite.detector(name="sift").parameters == {}
    assert suite.detector(name="sift", parameters={"octaves": 3}).parameters == {"octaves": 3}
    assert suite.detector(stretch=None).stretch == 2.0


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("frames = 10", "frames = 0", "corpus.frames: .*greater than or equal to 1"),
        ('name = "mine"\n[corpus]', 'name = "../mine"\n[corpus]', "name: "),
        ("[corpus]", "tolerance_px = -1\n[corpus]", "tolerance_px"),
        ("[corpus]", "nonsense = 1\n[corpus]", "nonsense"),
        ("[corpus]", "[corpus", r"mine\.toml"),
    ],
)
def test_what_is_no_suite_is_one_line(tmp_path: Path, old: str, new: str, words: str) -> None:
    with pytest.raises(InputError, match=words) as caught:
        suite_of(tmp_path, MINIMAL.replace(old, new, 1))
    assert "\n" not in str(caught.value)
    assert "it's mine.toml" in str(caught.value)


def test_a_suite_that_is_not_there_is_one_line() -> None:
    with pytest.raises(InputError, match="nowhere"):
        load_suite("nowhere")


@pytest.mark.parametrize("name", ["traced", "warped"])
def test_suites_of_other_images_take_their_frames_from_the_corpora_that_ship(name: str) -> None:
    suite = load_suite(name)
    corpus = load_spec(suite.folder / f"corpus_{name}.toml", frames=60)
    assert suite.detector().name == "identify"
    assert suite.table.corpus.model_copy(update={"store": corpus.store}) == corpus
