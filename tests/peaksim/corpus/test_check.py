"""check_corpus: finds any changed, missing or added file, and follows no name out of the folder."""

import json
from contextlib import suppress
from pathlib import Path

import pytest
from peaksim.corpus import check_corpus, make_corpus
from peaksim.errors import InputError

from tests.peaksim.corpus.helpers import contents, tiny_spec, write_tiny_scene


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """A finished corpus as file contents."""
    folder = tmp_path_factory.mktemp("made")
    make_corpus(tiny_spec(frames=6), write_tiny_scene(folder / "specs"), str(folder / "c"))
    return contents(folder / "c")


@pytest.fixture
def corpus(made: dict[str, bytes], tmp_path: Path) -> Path:
    """A fresh copy of it."""
    for name, content in made.items():
        (tmp_path / "c" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "c" / name).write_bytes(content)
    return tmp_path / "c"


def test_an_untouched_corpus_has_no_faults_and_every_file_is_looked_at(corpus: Path, made: dict[str, bytes]) -> None:
    checked: list[None] = []
    assert check_corpus(str(corpus), lambda: checked.append(None)) == []
    assert len(checked) == len(made) - 1  # the manifest vouches for all others


def test_every_single_changed_byte_is_found(corpus: Path, made: dict[str, bytes]) -> None:
    """One file of each kind is changed, one after another."""
    kinds = {name.rsplit(".", 1)[-1] + name.split("/")[0]: name for name in made if name != "manifest.json"}
    for name in kinds.values():
        content = bytearray(made[name])
        content[len(content) // 2] ^= 1
        (corpus / name).write_bytes(content)
        if name == "corpus.json" or name.startswith("sums/"):
            with suppress(InputError):  # no longer readable as what it was
                assert any(repr(name) in fault for fault in check_corpus(str(corpus)))
        else:
            assert check_corpus(str(corpus)) == [f"{name!r}: is not what was written"]
        (corpus / name).write_bytes(made[name])


def test_missing_and_added_files_are_found(corpus: Path) -> None:
    (corpus / "frames/000000/00000001.png").unlink()
    (corpus / "frames/000000/notes <b>.txt").write_text("x")
    (corpus / "detections").mkdir()
    (corpus / "detections" / "surf.parquet").write_text("results may lie beside the corpus")
    assert check_corpus(str(corpus)) == [
        "'frames/000000/00000001.png': is missing",
        "'frames/000000/notes <b>.txt': is not of the corpus",
    ]


@pytest.mark.parametrize("name", ["../../etc/passwd", "/etc/passwd", "frames/../../x", "<script>alert(1)</script>"])
def test_a_manifest_that_points_elsewhere_is_not_followed(corpus: Path, name: str) -> None:
    manifest = json.loads((corpus / "manifest.json").read_text())
    manifest["sha256"][name] = "0" * 64
    (corpus / "manifest.json").write_text(json.dumps(manifest))
    assert check_corpus(str(corpus)) == [f"{name!r}: is not a plain file name"]


@pytest.mark.parametrize("content", ["", "{", "[]", '{"sha256": [1]}'])
def test_a_manifest_that_is_none_is_one_line(corpus: Path, content: str) -> None:
    (corpus / "manifest.json").write_text(content)
    with pytest.raises(InputError, match=r"manifest\.json: expected the manifest of a corpus"):
        check_corpus(str(corpus))


def test_sums_that_are_none_are_one_line(corpus: Path) -> None:
    (corpus / "sums" / "part-000000.sha256").write_text("rubbish\n")
    with pytest.raises(InputError, match="expected lines of check sums, got 'rubbish'"):
        check_corpus(str(corpus))


def test_an_unfinished_corpus_is_said_to_be_so(corpus: Path) -> None:
    (corpus / "manifest.json").unlink()
    with pytest.raises(InputError, match="expected a finished corpus"):
        check_corpus(str(corpus))
