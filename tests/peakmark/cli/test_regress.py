"""`peakmark regress`: run, accept and compare as one types them; exit 1 on a regression, 2 on bad input."""

import json
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import pytest

from peakmark.cli.app import app
from peakmark.cli.command import run_command
from peakmark.regress.record import Record, read_record, to_text
from tests.peakmark.regress.helpers import frame, make_small_corpus, marker, missed, record, sound


def peakmark(*arguments: object) -> int:
    """Return the exit status of `peakmark ARGUMENTS`."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("sys.argv", ["peakmark", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            run_command(app)
    return int(ended.value.code or 0)


def run_folder(folder: Path, made: Record) -> Path:
    """Return a folder as `regress run` leaves it."""
    folder.mkdir()
    (folder / "run.json").write_text(to_text(made), encoding="utf-8")
    return folder


@pytest.mark.slow
def test_run_accept_compare_and_a_planted_fault(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    corpus = make_small_corpus(tmp_path)
    for name, options in (("good", ()), ("bad", ("--threshold", 200))):
        common = (corpus, "--stretch", 1.5, "--workers", 1, "--out", tmp_path / name)
        assert peakmark("regress", "run", *common, *options) == 0
    assert (tmp_path / "good" / "result.json").exists()
    assert len(list((tmp_path / "good" / "pictures").iterdir())) == 20
    baseline = tmp_path / "the team's" / "baseline.json"
    assert peakmark("regress", "accept", tmp_path / "good", "--baseline", baseline) == 0
    assert read_record(baseline) == read_record(tmp_path / "good" / "run.json")
    assert peakmark("regress", "compare", tmp_path / "good", "--baseline", baseline, "--out", tmp_path / "same") == 0
    assert "no regression" in capsys.readouterr().out
    assert peakmark("regress", "compare", tmp_path / "bad", "--baseline", baseline, "--out", tmp_path / "worse") == 1
    assert "features" in capsys.readouterr().out
    assert {path.name for path in (tmp_path / "worse").iterdir()} == {
        "report.html",
        "summary.md",
        "junit.xml",
        "result.json",
    }
    assert json.loads((tmp_path / "worse" / "result.json").read_text())["regression"] is True
    (suite,) = ElementTree.parse(tmp_path / "worse" / "junit.xml").getroot()
    assert int(suite.attrib["failures"]) > 0


def test_a_missing_or_foreign_baseline_is_one_line_and_status_2(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = run_folder(tmp_path / "run", sound())
    other = to_text(replace(sound(), suite="cave"))
    cases = {
        "nowhere.json": (None, "cannot be read"),
        "other suite.json": (other, "expected one of suite 'made-up', got one of 'cave'"),
        "older.json": (to_text(sound()).replace("regress-1", "regress-0"), "expected a record of version"),
        "rubbish.json": ("not JSON", "expected the record of a run"),
    }
    for name, (text, words) in cases.items():
        if text is not None:
            (tmp_path / name).write_text(text)
        assert peakmark("regress", "compare", run, "--baseline", tmp_path / name, "--out", tmp_path / "out") == 2
        error = capsys.readouterr().err
        assert words in error
        assert error.count("\n") == 1
        assert not (tmp_path / "out").exists()


def test_control_characters_reach_no_terminal(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    made = replace(sound(), suite="\x1b[2J\x07[red]suite")
    run = run_folder(tmp_path / "run", made)
    assert peakmark("regress", "compare", run, "--baseline", run / "run.json", "--out", tmp_path / "\x1b[31mout") == 0
    out = capsys.readouterr().out
    assert "\\x1b[2J\\x07[red]suite" in "".join(out.split())
    assert not {"\x1b", "\x07"} & set(out)


@pytest.mark.parametrize("bad", ["NaN", "Infinity", "-Infinity", "1e999", "1e300", "9" * 400, '"7"', "[" * 100_000])
def test_a_baseline_without_numbers_is_no_pass(tmp_path: Path, capsys: pytest.CaptureFixture[str], bad: str) -> None:
    lost = replace(sound(), results=tuple(replace(f, markers={"a": missed(), "b": missed()}) for f in sound().results))
    run = run_folder(tmp_path / "run", lost)
    baseline = tmp_path / "baseline.json"
    baseline.write_text(
        to_text(sound()).replace('"xy": [50.0,', f'"xy": [{bad},').replace('"side_px": 30.0', f'"side_px": {bad}')
    )
    assert peakmark("regress", "compare", run, "--baseline", baseline, "--out", tmp_path / "out") == 2
    error = capsys.readouterr().err
    assert error.startswith(f"error: {baseline}: expected the record of a run: ")
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_a_damaged_image_of_the_run_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lost = replace(sound(), results=tuple(replace(f, markers={"a": missed(), "b": missed()}) for f in sound().results))
    run = run_folder(tmp_path / "run", lost)
    (tmp_path / "baseline.json").write_text(to_text(sound()))
    (run / "pictures").mkdir()
    for i in range(20):
        (run / "pictures" / f"{i:08d}.jpg").write_bytes(b"%!PS-Adobe")
    assert peakmark("regress", "compare", run, "--baseline", tmp_path / "baseline.json", "--out", tmp_path / "out") == 2
    assert capsys.readouterr().err.startswith(f"error: {run / 'pictures'}/00000000.jpg: expected an image")


def test_accepting_writes_whole_or_not_at_all(tmp_path: Path) -> None:
    run = run_folder(tmp_path / "run", sound())
    (tmp_path / "folder").mkdir()
    assert peakmark("regress", "accept", run, "--baseline", tmp_path / "folder") == 2
    assert peakmark("regress", "accept", tmp_path, "--baseline", tmp_path / "b.json") == 2
    assert sorted(path.name for path in tmp_path.iterdir()) == ["folder", "run"]


def test_hostile_names_stay_in_the_folder_and_run_nothing(tmp_path: Path) -> None:
    """A record whose suite, detector, markers and failures are HTML and paths."""
    evil = "../../<img src=x onerror=alert(1)>'\""
    lost = replace(missed(), true_xy=(5.0, 5.0))
    before = record(*(replace(f, markers={evil: marker()}) for f in sound().results), suite=evil)
    after = record(
        *(frame(i, failure=evil) for i in range(20)), suite=evil, detector=replace(before.detector, name=evil)
    )
    after = replace(after, results=tuple(replace(f, markers={evil: lost}) for f in after.results))
    baseline = tmp_path / "it's a <b>.json"
    baseline.write_text(to_text(before), encoding="utf-8")
    run = run_folder(tmp_path / "run's <folder>", after)
    out = tmp_path / "out"
    assert peakmark("regress", "compare", run, "--baseline", baseline, "--out", out, "--quiet") == 1
    assert "<img src=x" not in (out / "report.html").read_text(encoding="utf-8")
    assert "<img" not in (out / "summary.md").read_text(encoding="utf-8")
    ElementTree.parse(out / "junit.xml")
    assert {p.name for p in tmp_path.iterdir()} == {baseline.name, run.name, "out"}


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("nowhere",), "nowhere"),
        (("floor", "--detector", "yolo"), "detector: expected one of"),
        (("floor", "--detector", "no_module:f"), "cannot be imported"),
        (("floor", "--stretch", "99"), "stretch: expected 0.25…8"),
        (("floor", "--stretch", "2", "--detector", "sift"), "--stretch 2: expected none for detector sift"),
        (("floor", "--seed", "-1"), "--seed: expected 0…2⁶³−1, got -1"),
        (("floor", "--start-limit", "0"), "start limit: expected more than 0 and at most 86400 s, got 0"),
        (("floor", "--workers", "2", "--dask", "tcp://x"), "--workers or --dask, not both"),
        (("floor", "--dask", "tcp://127.0.0.1:9"), "expected a scheduler, none answers there"),
    ],
)
def test_bad_input_is_one_line_and_status_2(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], options: tuple[str, ...], words: str
) -> None:
    assert peakmark("regress", "run", *options, "--quick", "--out", tmp_path / "out") == 2
    error = capsys.readouterr().err
    assert words in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()
