"""Imports point one way: scripts → peakmark → peaksim, and in each along scene → render → detect → score → report."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
SOURCES = sorted([*ROOT.glob("sim/peaksim/**/*.py"), *ROOT.glob("src/peakmark/**/*.py"), *ROOT.glob("scripts/*.py")])

# each module may import only modules of its own stage or an earlier one
STAGES = (
    ("errors", "pose", "shipped", "toml_file", "image_file", "keypoints", "integral", "parallel"),
    ("camera", "texture", "scene", "trajectory", "marker", "optimum", "surf", "sift", "detectors"),
    ("render", "truth", "flow", "shutter", "sensor", "frame", "signature", "refine", "sheet"),
    ("scene_file", "scene_build", "scene_posters", "scene_schema", "floor_path", "ride"),
    ("identification", "classification", "arrays", "localise", "stretch", "tracks", "drive", "finder", "finders"),
    ("score", "corpus", "envelope"),
    ("overlay", "film", "plots", "report", "results"),
    ("experiments", "corpus_show", "regress"),
    ("cli", "command"),
)


def imports(path: Path) -> set[str]:
    """Return the dotted names that a module imports, at its top or inside functions."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            found |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return found


def stage(dotted: str) -> int | None:
    """Return the stage of a module by the longest listed prefix of its file name, None if not listed."""
    parts = dotted.split(".")
    if len(parts) < 2:
        return None
    name = parts[1]
    matches = [(len(prefix), i) for i, stage in enumerate(STAGES) for prefix in stage
               if name == prefix or name.startswith(prefix + "_")]  # fmt: skip
    return max(matches)[1] if matches else None


def dotted(path: Path) -> str:
    """Return a source file's dotted module name."""
    base = ROOT / ("sim" if "sim" in path.relative_to(ROOT).parts[:1] else "src")
    return ".".join(path.relative_to(base).with_suffix("").parts)


def test_the_sources_are_there() -> None:
    assert len(SOURCES) > 20


@pytest.mark.parametrize("path", SOURCES, ids=lambda p: str(p.relative_to(ROOT)))
def test_imports_keep_their_direction(path: Path) -> None:
    names = imports(path)
    if path.is_relative_to(ROOT / "sim"):
        assert not {n for n in names if n.split(".")[0] == "peakmark"}, "the simulator knows nothing of detectors"
    if path.is_relative_to(ROOT / "scripts"):
        return
    own = stage(dotted(path))
    if own is not None:
        later = {n for n in names if n.split(".")[0] in ("peaksim", "peakmark") and (stage(n) or 0) > own}
        assert not later, f"{path.name} is of stage {own} and imports from a later one"


def test_one_file_imports_the_gl_renderer() -> None:
    importers = {p.name for p in SOURCES if any(n.split(".")[0] in ("pyrender", "OpenGL") for n in imports(p))}
    assert all(name.startswith("render_gl") for name in importers)


def test_scripts_hold_no_logic() -> None:
    for path in ROOT.glob("scripts/*.py"):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        assert not [n for n in ast.walk(tree) if isinstance(n, ast.FunctionDef | ast.ClassDef | ast.For | ast.While)]
