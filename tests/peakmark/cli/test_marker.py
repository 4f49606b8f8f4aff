import json

import pytest
import typer
from typer.testing import CliRunner

from peakmark.cli.marker import marker
from peakmark.errors import InputError

app = typer.Typer()
app.command()(marker)


def run(*arguments):
    return CliRunner().invoke(app, [str(argument) for argument in arguments], catch_exceptions=True)


@pytest.mark.parametrize(
    ("arguments", "name", "markers"),
    [
        (["surf"], "surf-dark-80mm.pdf", 1),
        (["surf", "--light", "--limit", "range", "--count", "2"], "surf-range-light-80mm.pdf", 2),
        (["sift", "--side-mm", "40", "--format", "svg"], "sift-dark-40mm.svg", 1),
        (["array", "--side-mm", "30"], "array-30mm.pdf", 24),
        (["array-5"], "array-5-60mm.pdf", 3),
        (["array-5", "--paper", "a5"], "array-5-45mm.pdf", 3),
        (["array-5", "--kind", "sift"], "array-5-sift-60mm.pdf", 3),
        (["array", "--paper", "a4", "--border-mm", "30"], "array-50mm.pdf", 24),
        (["array-5", "--side-mm", "60", "--paper", "a3", "--landscape"], "array-5-60mm.pdf", 3),
    ],
)
def test_command_writes_the_sheet_and_its_result(arguments, name, markers, tmp_path):
    outcome = run(*arguments, "--out", tmp_path)
    assert outcome.exit_code == 0, outcome.output
    assert name in outcome.output
    result = json.loads((tmp_path / "result.json").read_text())
    assert result["files"] == [name]
    assert len(result["markers"]) == markers
    assert (tmp_path / name).stat().st_size > 500


def test_result_says_where_each_marker_is(tmp_path):
    assert run("array-1", "--side-mm", 40, "--gap-mm", 20, "--out", tmp_path, "--quiet").output == ""
    markers = json.loads((tmp_path / "result.json").read_text())["markers"]
    first, second, third = (m["center_mm"] for m in markers)
    assert first[0] - second[0] == pytest.approx(60)
    assert second[1] - first[1] == pytest.approx(60)
    assert third == [first[0], second[1]]
    assert [m["polarity"] for m in markers] == ["dark", "dark", "light"]


@pytest.mark.parametrize(
    "arguments",
    [
        ["orb"],
        ["array-8"],
        ["surf", "--limit", "power"],
        ["surf", "--count", "0"],
        ["array", "--kind", "orb"],
        ["surf", "--side-mm", "300"],
    ],
)
def test_bad_input_is_an_input_error(arguments, tmp_path):
    assert isinstance(run(*arguments, "--out", tmp_path).exception, InputError)
    assert not list(tmp_path.iterdir())
