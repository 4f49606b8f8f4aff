"""check_corpus: finds any changed, missing or added file, and follows no name out of the folder."""

import json
from contextlib import suppress
from hashlib import sha256
from pathlib import Path

import pytest
from peaksim.corpus import check_corpus, make_corpus, open_corpus, sums
from peaksim.corpus.check import unchecked_inputs
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


@pytest.mark.parametrize("name", ["manifest.json", "corpus.json"])
def test_json_of_any_depth_or_size_is_read_and_refused(corpus: Path, name: str) -> None:
    for content in ("[" * 200_000, '{"a":' * 200_000, '{"format": ' + "9" * 5000 + "}"):
        (corpus / name).write_text(content)
        if name == "manifest.json":
            with pytest.raises(InputError, match=r"manifest\.json: expected the manifest of a corpus"):
                check_corpus(str(corpus))
        else:
            assert check_corpus(str(corpus)) == ["'corpus.json': is not what was written"]
            with pytest.raises(InputError, match=r"corpus\.json: expected") as caught:
                open_corpus(str(corpus))
            assert len(str(caught.value)) < 400


def test_every_fault_is_listed_beside_sums_with_broken_lines(corpus: Path) -> None:
    sums = corpus / "sums" / "shard-000001.sha256"
    lines = sums.read_text().splitlines()
    sums.write_text("\n".join([lines[0], "rubbish\x1b[31m", "x" * 1_000_000, *lines[3:]]) + "\n")
    (corpus / "frames/000000/00000001.png").unlink()
    (corpus / "tables/000000/poses_tum.txt").write_text("1\n")
    lost = sorted(line[66:] for line in lines[1:3])
    assert sorted(check_corpus(str(corpus))) == sorted(
        [
            "'frames/000000/00000001.png': is missing",
            *(f"{name!r}: is not listed in 'sums/shard-000001.sha256'" for name in lost),
            "'sums/shard-000001.sha256': is not what was written",
            "'sums/shard-000001.sha256': line 2: expected a check sum and a name, got 'rubbish\\x1b[31m' (and 1 more)",
            "'tables/000000/poses_tum.txt': is not what was written",
        ]
    )


def seal_again(corpus: Path, name: str) -> None:
    """Make the manifest vouch for a part's sums as they are now."""
    manifest = json.loads((corpus / "manifest.json").read_text())
    manifest["sha256"][name] = sha256((corpus / name).read_bytes()).hexdigest()
    (corpus / "manifest.json").write_text(json.dumps(manifest, indent=2, ensure_ascii=False) + "\n")


@pytest.mark.parametrize("named", ["sums/part-000000.sha256", "manifest.json", "sums/shard-000000.sha256", "sums/x"])
def test_lists_that_name_each_other_come_to_an_end(corpus: Path, named: str) -> None:
    part, shard = corpus / "sums" / "part-000000.sha256", corpus / "sums" / "shard-000000.sha256"
    for file in (part, shard):
        file.write_text(file.read_text() + f"{'0' * 64}  {named}\n{'0' * 64}  sums/part-000000.sha256\n")
    seal_again(corpus, "sums/part-000000.sha256")
    faults = check_corpus(str(corpus))
    for kind in ("part", "shard"):
        wrong = f"'sums/part-000000.sha256': is listed in 'sums/{kind}-000000.sha256', where it does not belong"
        assert wrong in faults
    assert "'sums/shard-000000.sha256': is not what was written" in faults


def test_a_long_chain_of_lists_comes_to_an_end(corpus: Path) -> None:
    for i in range(3000):
        (corpus / "sums" / f"link{i}").write_text(f"{'0' * 64}  sums/link{i + 1}\n")
    (corpus / "sums" / "part-000000.sha256").write_text(f"{'0' * 64}  sums/link0\n")
    assert "'sums/link3000': is missing" in check_corpus(str(corpus))


@pytest.mark.parametrize(
    ("field", "value"),
    [("seed", 4), ("frames", 25), ("frames", 6.0), ("name", "x"), ("renderer", "gl"), ("versions", {}), ("new", 1)],
    ids=str,
)
def test_a_changed_field_of_the_manifest_is_found(corpus: Path, field: str, value: object) -> None:
    manifest = json.loads((corpus / "manifest.json").read_text())
    manifest[field] = value
    (corpus / "manifest.json").write_text(json.dumps(manifest, indent=2, ensure_ascii=False) + "\n")
    (fault,) = check_corpus(str(corpus))
    same = field == "frames" and value == 6  # equal as a number, other bytes
    assert fault.startswith("'manifest.json': " + ("is not what was written" if same else f"'{field}' is {value!r}"))


@pytest.mark.parametrize("change", [("\n", ""), ('"seed": 5', '"seed": 6, "seed": 5'), ("{", " {")], ids=str)
def test_every_byte_of_the_manifest_counts(corpus: Path, change: tuple[str, str]) -> None:
    (corpus / "manifest.json").write_text((corpus / "manifest.json").read_text().replace(*change))
    assert check_corpus(str(corpus)) == ["'manifest.json': is not what was written"]


def test_a_part_that_is_left_out_is_missed_also_where_every_hash_fits(corpus: Path) -> None:
    manifest = json.loads((corpus / "manifest.json").read_text())
    del manifest["sha256"]["sums/part-000000.sha256"]
    (corpus / "manifest.json").write_text(json.dumps(manifest, indent=2, ensure_ascii=False) + "\n")
    assert check_corpus(str(corpus)) == ["'sums/part-000000.sha256': is not listed in 'manifest.json'"]


def test_a_list_that_is_missing_or_too_large_hides_no_other_fault(
    corpus: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (corpus / "frames/000001/00000004.png").write_bytes(b"x")
    (corpus / "sums" / "part-000000.sha256").unlink()
    faults = check_corpus(str(corpus))
    assert faults == ["'sums/part-000000.sha256': is missing", "'frames/000001/00000004.png': is not what was written"]
    monkeypatch.setattr(sums, "LARGEST_LIST", 100)
    too_large = [fault for fault in check_corpus(str(corpus)) if "is larger than 100 bytes" in fault]
    assert len(too_large) == 2


def test_input_files_that_are_here_are_compared_and_others_are_named(corpus: Path, tmp_path: Path) -> None:
    folder = write_tiny_scene(tmp_path / "specs")
    assert unchecked_inputs(str(corpus)) == ["plain.png", "striped.png", "tiny.toml"]
    assert (check_corpus(str(corpus), folder=folder), unchecked_inputs(str(corpus), folder)) == ([], [])
    (folder / "plain.png").write_bytes(b"another")
    (folder / "striped.png").unlink()
    fault = "'plain.png': the input file is not the one of which the corpus was made"
    assert check_corpus(str(corpus), folder=folder) == [fault]
    assert unchecked_inputs(str(corpus), folder) == ["striped.png"]


def test_an_unfinished_corpus_is_said_to_be_so(corpus: Path) -> None:
    (corpus / "manifest.json").unlink()
    with pytest.raises(InputError, match="expected a finished corpus"):
        check_corpus(str(corpus))
