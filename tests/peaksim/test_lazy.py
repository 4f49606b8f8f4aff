"""Public names are imported when first used, and each is what its package says."""

import subprocess
import sys
import tomllib
from importlib import import_module
from importlib.metadata import version
from types import ModuleType

import pytest
from peaksim.lazy import lazy_names

from tests.peaksim.corpus.helpers import child_environment
from tests.places import ROOT, SOURCES

PACKAGES = ("peaksim", "peaksim.corpus", "peakmark")


@pytest.mark.parametrize("package", PACKAGES)
def test_every_public_name_is_there_and_listed(package: str) -> None:
    module = import_module(package)
    assert dir(module) == sorted(module.__all__)
    modules = {name for name in module.__all__ if isinstance(getattr(module, name), ModuleType)}
    assert modules == ({"marker", "surf"} if package == "peakmark" else set())


@pytest.mark.parametrize("package", PACKAGES)
def test_type_checkers_see_every_public_name(package: str) -> None:
    source = import_module(package).__file__
    assert source is not None
    text = (ROOT / source).read_text()
    assert all(f" as {name}\n" in text or f" as {name}  #" in text for name in import_module(package).__all__)


def test_an_unknown_name_is_an_attribute_error() -> None:
    _, get, _ = lazy_names("house", {"ascii_letters": "string"})
    assert get("ascii_letters").startswith("abc")
    with pytest.raises(AttributeError, match="module 'house' has no attribute 'cellar'"):
        get("cellar")


def test_importing_a_package_imports_nothing_heavy() -> None:
    code = "import peaksim, peakmark, sys; print({'numpy', 'cv2', 'scipy'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], env={"PYTHONPATH": SOURCES}, capture_output=True, text=True)
    assert done.stdout == "set()\n", done.stderr


def test_the_package_and_its_command_tell_the_version() -> None:
    written = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    assert import_module("peakmark").__version__ == version("peakmark") == written
    done = subprocess.run(
        [sys.executable, "-m", "peakmark.cli", "--version"], env=child_environment(), capture_output=True, check=False
    )
    assert (done.stdout.decode(), done.stderr, done.returncode) == (f"peakmark {written}\n", b"", 0)
