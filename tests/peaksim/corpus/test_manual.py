"""CORPUS.md names everything that there is: each field of a specification, each file, each column."""

import re
from fnmatch import fnmatch
from pathlib import Path

import pytest
from peaksim.corpus import CorpusSpec, layout, make_corpus
from peaksim.corpus.sample import KEYPOINTS
from peaksim.corpus.tables import FRAME_COLUMNS, MARKER_COLUMNS
from peaksim.scene.schema import StrictTable

from tests.peaksim.corpus.helpers import contents, tiny_records, tiny_spec
from tests.places import ROOT

MANUAL = (ROOT / "CORPUS.md").read_text(encoding="utf-8")
PROSE = re.sub(r"```.*?```", "", MANUAL, flags=re.DOTALL)
WORDS = set(re.findall(r"[A-Za-z][A-Za-z0-9_]*", " ".join(re.findall(r"`([^`]+)`", PROSE))))
TREE = MANUAL.split("## On disk")[1].split("```")[1]

TABLES = [table for table in StrictTable.__subclasses__() if table.__module__.startswith(CorpusSpec.__module__)]


@pytest.mark.parametrize("table", TABLES, ids=lambda table: table.__name__)
def test_every_field_of_a_specification_is_explained(table: type[StrictTable]) -> None:
    assert set(table.model_fields) <= WORDS


def test_every_file_is_in_the_tree(folder: Path, tmp_path: Path) -> None:
    make_corpus(tiny_spec(), folder, str(tmp_path / "c"))
    drawn = [line.split()[0] for line in TREE.strip().splitlines()]
    patterns = [re.sub(r"[SFP]{6,8}", "[0-9]*", name).replace("NAME", "*") for name in drawn]
    patterns += [pattern.removesuffix("png|jpg") + "png" for pattern in patterns]
    for name in contents(tmp_path / "c"):
        assert any(fnmatch(name, pattern) for pattern in patterns), name


def test_every_column_and_field_of_a_record_is_explained(folder: Path) -> None:
    record = tiny_records(tiny_spec(frames=1), folder)[0]
    points = {f"{point}_{end}" for point in KEYPOINTS for end in ("x", "y", "seen")}
    assert set(record) | set(record["camera"]) | set(record["markers"][0]) <= WORDS
    assert set(FRAME_COLUMNS) | set(MARKER_COLUMNS) - points <= WORDS
    assert set(KEYPOINTS) <= WORDS


def test_the_format_is_the_one_described() -> None:
    assert f"`{layout.FORMAT}`" in MANUAL
