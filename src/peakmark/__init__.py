"""peakmark: maximum detector response markers for SIFT and SURF (Schweiger et al., 2009).

Names are imported when first used, so that `import peakmark` stays quick and compiles nothing.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from peakmark import surf
    from peakmark.arrays.decode import decode_arrays
    from peakmark.identification.api import identify
    from peakmark.identification.detection import Detection
    from peakmark.keypoints.keypoints import Keypoints
    from peakmark.markers import patterns as marker

_HOMES = {
    "Detection": ("peakmark.identification.detection", "Detection"),
    "Keypoints": ("peakmark.keypoints.keypoints", "Keypoints"),
    "decode_arrays": ("peakmark.arrays.decode", "decode_arrays"),
    "identify": ("peakmark.identification.api", "identify"),
    "marker": ("peakmark.markers.patterns", None),
    "surf": ("peakmark.surf", None),
}
"""Public name → (module, attribute in it); None is the module itself."""

__all__ = ["Detection", "Keypoints", "decode_arrays", "identify", "marker", "surf"]


def __getattr__(name: str) -> Any:
    """Import a public name on first use (PEP 562)."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module_name, attribute = _HOMES[name]
    module = import_module(module_name)
    return module if attribute is None else getattr(module, attribute)


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOMES})
