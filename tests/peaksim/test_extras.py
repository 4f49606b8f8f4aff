"""Every library that only some jobs need is in the extra that a message names."""

import ast
import sys
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from peaksim.extras import EXTRAS, how_to_install
from peaksim.scene.mesh_file import read_mesh

from peakmark.cli.film_file import read_film
from peakmark.found.tables import write_rows
from peakmark.report.film import film
from peakmark.report.page import write_report
from peakmark.report.plots import new_figure
from tests.places import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
PACKAGES = {"OpenGL": "PyOpenGL", "pyrender": "scikit-robot-pyrender", "mpl_toolkits": "matplotlib", "drjit": "mitsuba"}
PACKAGES |= {
    "skimage": "scikit-image",
    "sklearn": "scikit-learn",
    "rerun": "rerun-sdk",
    "pupil_apriltags": "pupil-apriltags",
    "locus": "locus-tag",
    "chess_corners": "chess-corners",
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


def public_functions_that_import_an_extra() -> Iterator[tuple[str, bool]]:
    """Yield the functions that import such a library, and whether a missing one is caught or told."""
    for path in [*(ROOT / "sim").rglob("*.py"), *(ROOT / "src").rglob("*.py")]:
        text = path.read_text("utf-8")
        tree = ast.parse(text) if any(f"import {name}" in text or f"from {name}" in text for name in EXTRAS) else None
        for function in ast.walk(tree) if tree is not None else ():
            if isinstance(function, ast.FunctionDef) and not function.name.startswith("_"):
                caught = {
                    node
                    for block in ast.walk(function)
                    if isinstance(block, ast.Try) and block.handlers
                    for line in block.body
                    for node in ast.walk(line)
                }
                if any(EXTRAS.keys() & tops(node) for node in set(ast.walk(function)) - caught):
                    told = any(
                        isinstance(name, ast.Name) and name.id == "needs_extra" for name in function.decorator_list
                    )
                    yield f"{path.relative_to(ROOT)}: {function.name}", told


def tops(node: ast.AST) -> set[str]:
    names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
    names += [node.module or ""] if isinstance(node, ast.ImportFrom) and not node.level else []
    return {name.partition(".")[0] for name in names}


def test_every_public_function_that_needs_an_extra_says_so() -> None:
    told = dict(public_functions_that_import_an_extra())
    assert len(told) > 15
    assert [name for name, is_told in told.items() if not is_told] == []


@pytest.mark.parametrize(
    ("library", "call"),
    [
        ("av", lambda: next(read_film(Path("a.mp4")))),
        ("av", lambda: film(Path("a.mp4"), 25, 64).__enter__()),
        ("jinja2", lambda: write_report(Path("a.html"), "", "", [])),
        ("matplotlib", lambda: new_figure()),
        ("pyarrow", lambda: write_rows(Path("a.parquet"), [])),
        ("trimesh", lambda: read_mesh(Path("none.ply"))),
    ],
)
def test_in_python_too_a_missing_extra_is_one_line(
    library: str, call: Callable[[], object], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(ModuleNotFoundError) as told:
        call()
    assert str(told.value) == f"this needs {library}: pip install 'peakmark[sim]'"
    assert told.value.name is not None
    assert told.value.name.startswith(library)
