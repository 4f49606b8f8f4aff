"""Every library that only some jobs need is in the extra that a message names."""

import tomllib

import pytest
from peaksim.extras import EXTRAS, how_to_install

from tests.places import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
PACKAGES = {"OpenGL": "PyOpenGL", "pyrender": "scikit-robot-pyrender", "mpl_toolkits": "matplotlib", "drjit": "mitsuba"}
PACKAGES |= {
    "skimage": "scikit-image",
    "sklearn": "scikit-learn",
    "rerun": "rerun-sdk",
    "pupil_apriltags": "pupil-apriltags",
}


@pytest.mark.parametrize("library", EXTRAS)
def test_the_extra_brings_the_library(library: str) -> None:
    needed = PROJECT["optional-dependencies"][EXTRAS[library]]
    package = PACKAGES.get(library, library)
    assert any(line.startswith((f"{package}>", f"{package}=")) for line in needed)
    assert not any(line.startswith(f"{package}>") for line in PROJECT["dependencies"])


def test_all_brings_every_extra_that_a_message_names() -> None:
    (line,) = PROJECT["optional-dependencies"]["all"]
    assert set(EXTRAS.values()) <= set(line.partition("[")[2].rstrip("]").split(","))


def test_a_library_of_no_extra_is_a_fault_of_our_own() -> None:
    assert how_to_install(ModuleNotFoundError("No module named 'peakmark.x'", name="peakmark.x")) is None
    assert how_to_install(ImportError("cannot import name 'x'")) is None
