"""Imports point one way: scripts → peakmark → peaksim, each package on its floor, no circle, no file left out."""

import ast
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.house import circles, files_of, graph_of, imported, parsed, upward
from tests.places import ROOT

SIM_FLOORS = (
    (
        "peaksim.errors",
        "peaksim.extras",
        "peaksim.folder_lock",
        "peaksim.lazy",
        "peaksim.notices",
        "peaksim.keep_last",
        "peaksim.threads",
        "peaksim.whole_file",
    ),
    ("peaksim.text_file", "peaksim.native_library"),
    ("peaksim.native",),
    ("peaksim.shipped", "peaksim.toml_file", "peaksim.image_file", "peaksim.exif_file", "peaksim.geometry"),
    ("peaksim.camera",),
    ("peaksim.scene",),
    ("peaksim.area",),
    ("peaksim.gl", "peaksim.traced", "peaksim.truth"),
    ("peaksim.rendering",),
    ("peaksim.corpus",),
    ("peaksim",),
)
"""Each room imports only rooms below it; a package's files may import each other, but not in a circle."""

FLOORS = (
    *SIM_FLOORS,
    ("peakmark.errors", "peakmark.version"),
    ("peakmark.parallel", "peakmark.plain"),
    ("peakmark.keypoints", "peakmark.markers"),
    ("peakmark.surf", "peakmark.refine"),
    ("peakmark.detectors",),
    ("peakmark.identification",),
    ("peakmark.arrays",),
    ("peakmark.localise",),
    ("peakmark.score", "peakmark.found"),
    ("peakmark.maps",),
    ("peakmark.recording",),
    ("peakmark.report",),
    (
        "peakmark.calibration",
        "peakmark.mapping",
        "peakmark.regress",
        "peakmark.experiments.journal",
        "peakmark.experiments.option",
    ),
    ("peakmark.experiments.drawing",),
    ("peakmark.experiments.photographs", "peakmark.experiments.run", "peakmark.experiments.scene_images"),
    ("peakmark.experiments.floor", "peakmark.experiments.detectability"),
    ("peakmark.experiments.robot", "peakmark.experiments.cave"),
    ("peakmark.experiments.search", "peakmark.experiments.images", "peakmark.experiments.calibration"),
    ("peakmark.experiments.comparison",),
    ("peakmark.experiments",),
    ("peakmark.cli",),
    ("peakmark",),
)
HEAVY = {
    "OpenGL",
    "av",
    "chess_corners",
    "distributed",
    "drjit",
    "evo",
    "fpdf",
    "fsspec",
    "mcap",
    "jinja2",
    "locus",
    "matplotlib",
    "mitsuba",
    "pandas",
    "plotly",
    "pupil_apriltags",
    "pyarrow",
    "pycolmap",
    "pyrender",
    "rerun",
    "ringgrid",
    "rosbags",
    "scipy.optimize",
    "skimage",
    "sklearn",
    "threadpoolctl",
    "trimesh",
}
"""Libraries that are slow to import, or optional: only they may be imported inside a function."""

FILES = files_of(ROOT / "sim", ROOT / "src")


def test_every_file_is_read() -> None:
    on_disk = [path for root in ("sim", "src") for path in (ROOT / root).rglob("*.py")]
    assert sorted(FILES.values()) == sorted(on_disk)


def test_no_file_imports_upward_and_none_is_left_out() -> None:
    assert upward(graph_of(FILES), FLOORS) == []


def test_no_files_import_each_other_in_a_circle() -> None:
    assert circles(graph_of(FILES)) == []


def test_the_simulator_knows_nothing_of_detectors() -> None:
    for name, path in files_of(ROOT / "sim").items():
        assert not [n for n in imported(path, name) if n.split(".")[0] == "peakmark"], name


def test_one_package_imports_the_gl_renderer() -> None:
    importers = {
        name for name, path in FILES.items() if {"pyrender", "OpenGL"} & {n.split(".")[0] for n in imported(path, name)}
    }
    assert importers
    assert all(name.startswith("peaksim.gl.") for name in importers)


def test_only_heavy_and_optional_libraries_are_imported_inside_functions() -> None:
    inside = {
        (name, other)
        for name, path in FILES.items()
        for function in ast.walk(parsed(path))
        if isinstance(function, ast.FunctionDef | ast.AsyncFunctionDef)
        for node in ast.walk(function)
        for other in _imports(node)
    }
    assert {(name, other) for name, other in inside if not _is_heavy(other)} == set()
    needed = {heavy for heavy in HEAVY for _, other in inside if f"{other}.".startswith(f"{heavy}.")}
    assert needed == HEAVY  # none is listed that no function imports


def _is_heavy(module: str) -> bool:
    return any(f"{module}.".startswith(f"{heavy}.") for heavy in HEAVY)


def _imports(node: ast.AST) -> list[str]:
    if isinstance(node, ast.Import):
        return [alias.name for alias in node.names]
    return [node.module or "."] if isinstance(node, ast.ImportFrom) else []


def test_parts_of_scipy_are_loaded_when_first_used() -> None:
    """`import scipy` is quick, and its parts come with their first attribute; named in an import each takes 0.3 s."""
    at_the_top = {
        (name, other) for name, path in FILES.items() for node in parsed(path).body for other in _imports(node)
    }
    assert {(name, other) for name, other in at_the_top if other.startswith("scipy.")} == set()


def test_scripts_hold_no_logic() -> None:
    for path in ROOT.glob("scripts/*.py"):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        assert not [n for n in ast.walk(tree) if isinstance(n, ast.FunctionDef | ast.ClassDef | ast.For | ast.While)]


def upward_lines(root: Path) -> list[str]:
    return upward(graph_of(files_of(root)), (("house.cellar",), ("house.ground",), ("house",)))


@pytest.mark.parametrize(
    ("planted", "faults"),
    [
        ({}, lambda root: upward_lines(root) + circles(graph_of(files_of(root)))),
        ({"cellar/stove.py": "from house.ground.door import open_it"}, upward_lines),
        ({"cellar/stove.py": "def heat():\n    from house.ground import door"}, upward_lines),
        ({"cellar/stove.py": "from ..ground import door"}, upward_lines),
        ({"attic.py": "", "__init__.py": ""}, lambda root: upward(graph_of(files_of(root)), (("house.cellar",),))),
        (
            {"cellar/stove.py": "import house.cellar.coal", "cellar/coal.py": "from house.cellar import stove"},
            lambda root: circles(graph_of(files_of(root))),
        ),
        (
            {
                "ground/a.py": "import house.ground.b",
                "ground/b.py": "import house.ground.c",
                "ground/c.py": "import house.ground.a",
            },
            lambda root: circles(graph_of(files_of(root))),
        ),
    ],
    ids=["sound", "upward", "inside a function", "relative", "on no floor", "circle of two", "circle of three"],
)
def test_planted_faults_are_seen(
    planted: dict[str, str], faults: Callable[[Path], list[object]], tmp_path: Path
) -> None:
    sound = {
        "__init__.py": "from house.ground.door import open_it",
        "cellar/__init__.py": "",
        "ground/__init__.py": "",
        "ground/door.py": "from house.cellar import coal\ndef open_it(): ...",
        "cellar/coal.py": "import ast",
    }
    for name, text in {**sound, **planted}.items():
        path = tmp_path / "house" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    assert bool(faults(tmp_path)) == bool(planted)
