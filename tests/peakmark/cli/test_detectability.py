import csv
import json
import shutil

import pytest
from typer import Typer
from typer.testing import CliRunner

from peakmark.cli.detectability import detectability
from peakmark.errors import InputError

app = Typer()
app.command()(detectability)

SMALL = ["--trials", "2", "--every", "100", "--only", "exposure", "--workers", "1", "--quiet"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return the folder of a small run, with a detector that always fails."""
    out = tmp_path_factory.mktemp("run")
    done = CliRunner().invoke(app, [*SMALL, "--detector", "builtins:len", "--out", str(out)])
    assert done.exit_code == 0, done.output
    assert done.output == ""
    return out


def test_a_run_leaves_rows_tables_figures_and_its_configuration(folder):
    result = json.loads((folder / "result.json").read_text())
    assert result["config"]["trials"] == 2
    assert len(result["tables"]["The paper's claims"]) == 11
    assert (folder / "tables.md").read_text("utf-8").startswith("## The paper's claims\n\n| claim of the paper | ")
    rows = list(csv.DictReader((folder / "rows.csv").open()))
    assert {r["detector"] for r in rows} == {"surf", "surf-paper", "sift", "builtins:len"}
    for name in (*(f"figure-{n}" for n in range(1, 7)), "exposure"):
        assert (folder / f"{name}.png").read_bytes().startswith(b"\x89PNG")
        assert (folder / f"{name}.svg").read_text().startswith("<?xml")


def test_the_report_names_the_faults(folder):
    page = (folder / "report.html").read_text()
    assert "Faults of detectors" in page
    assert "InputError: detector: expected Keypoints" in page


def test_report_only_writes_the_same_from_the_finished_points(folder, tmp_path):
    shutil.copy(folder / "journal.jsonl", tmp_path)
    options = [*SMALL, "--detector", "builtins:len", "--out", str(tmp_path), "--report-only"]
    assert CliRunner().invoke(app, options).exit_code == 0
    for name in ("rows.csv", "result.json", "exposure.png", "exposure.svg"):
        assert (tmp_path / name).read_bytes() == (folder / name).read_bytes()


@pytest.mark.parametrize("options", [["--trials", "0"], ["--only", "luck"], ["--detector", "orb"], ["--report-only"]])
def test_bad_options_are_refused_in_one_line(tmp_path, options):
    done = CliRunner().invoke(app, ["--out", str(tmp_path / "out"), "--quiet", *options])
    assert isinstance(done.exception, InputError)
    assert "\n" not in str(done.exception)
