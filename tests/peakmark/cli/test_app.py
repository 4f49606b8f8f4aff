"""The list of commands: quick, and true to the commands that it names."""

import os
import subprocess
import sys

import pytest
from typer.testing import CliRunner

from peakmark.cli.app import COMMANDS, app, load_command
from tests.places import SOURCES

ENVIRONMENT = {**os.environ, "PYTHONPATH": SOURCES}


@pytest.mark.parametrize("name", COMMANDS)
def test_the_list_has_the_commands_own_words(name: str) -> None:
    command = load_command(name)
    assert command.help.splitlines()[0] == COMMANDS[name][1]


def test_help_lists_every_command_and_imports_none() -> None:
    code = (
        "import sys\nfrom peakmark.cli.app import app\n"
        "try: app(['--help'])\n"
        "finally: print(*{'numpy', 'cv2', 'scipy', 'pydantic'} & set(sys.modules), file=sys.stderr)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, env=ENVIRONMENT, timeout=60
    )
    assert done.stderr.split() == []
    assert all(f" {name} " in done.stdout for name in COMMANDS)


def test_a_command_has_its_own_help() -> None:
    done = CliRunner().invoke(app, ["detect", "--help"])
    assert done.exit_code == 0
    assert "Usage: root detect" in " ".join(done.output.split())
    assert "--threshold" in done.output


def test_a_mistyped_command_is_refused_with_a_guess() -> None:
    done = CliRunner().invoke(app, ["corpu"])
    assert done.exit_code == 2
    assert "Did you mean 'corpus'?" in done.output


@pytest.mark.parametrize(("typed", "offered"), [("peakmark ident", "identify"), ("peakmark fly --ren", "--renderer")])
def test_a_shell_completes_commands_and_options(typed: str, offered: str) -> None:
    environment = {**ENVIRONMENT, "_PEAKMARK_COMPLETE": "complete_bash", "COMP_WORDS": typed}
    environment["COMP_CWORD"] = str(len(typed.split()) - 1)
    code = "from peakmark.cli.app import app\napp(prog_name='peakmark')"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment, timeout=60)
    assert offered in done.stdout.split()
