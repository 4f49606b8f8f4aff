"""The pages of the API: each public name of each package, shown from its docstring by mkdocstrings."""

from collections.abc import Iterator
from importlib import import_module
from types import ModuleType

PAGES = {
    "peakmark": ("peakmark", "Find markers, read arrays, tell where the camera is."),
    "finding": (
        "peakmark.found peakmark.identification peakmark.arrays peakmark.refine",
        "Image → markers and arrays.",
    ),
    "locating": ("peakmark.maps peakmark.localise", "Markers and arrays → where the camera is."),
    "measuring": ("peakmark.calibration peakmark.mapping", "Photographs → a camera, and a map of a room."),
    "patterns": ("peakmark.markers peakmark.markers.patterns", "Patterns, the optimum behind them, array codes."),
    "surf": (
        "peakmark.surf peakmark.keypoints peakmark.detectors",
        "Key points: SURF as OpenCV's, and detectors by name.",
    ),
    "scoring": ("peakmark.score peakmark.regress.detector_protocol", "Detections against truth."),
    "errors": ("peakmark.errors", "What is raised."),
    "peaksim": ("peaksim", "Load a scene, render it, with truth."),
    "scenes": (
        "peaksim.scene peaksim.scene.placing peaksim.scene.lamps peaksim.scene.material",
        "Surfaces, meshes, lights and paper as values.",
    ),
    "cameras": ("peaksim.camera peaksim.geometry peaksim.truth", "Cameras, sensors, poses, trajectories, truth."),
    "corpora": ("peaksim.corpus", "Annotated image sets."),
}
"""Page below reference/api → the packages and modules that it shows, and its first sentence."""


def public_names(module: ModuleType) -> list[str]:
    """Return a module's `__all__`, or else the functions and classes that are defined in it and start with no _."""
    if hasattr(module, "__all__"):
        return [name for name in module.__all__ if name != "__version__" and not _is_module(module, name)]
    return [
        name
        for name, value in vars(module).items()
        if not name.startswith("_") and getattr(value, "__module__", None) == module.__name__
    ]


def _is_module(module: ModuleType, name: str) -> bool:
    return isinstance(getattr(module, name), ModuleType)


def api_pages() -> Iterator[tuple[str, str]]:
    """Yield each page's path in the site, and its text."""
    for page, (modules, sentence) in PAGES.items():
        parts = [f"# {_title(page, modules)}\n\n{sentence}\n"]
        for name in modules.split():
            parts += [f"## {name}\n"] if name != modules else []
            parts += [f"::: {name}.{public}\n" for public in sorted(public_names(import_module(name)), key=str.lower)]
        yield f"reference/api/{page}.md", "\n".join(parts)


def _title(page: str, modules: str) -> str:
    return page if modules == page else page.capitalize()
