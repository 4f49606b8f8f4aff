"""Which extra brings a library that is not installed: the core does without those that only some jobs need."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from inspect import isgeneratorfunction
from typing import Any, ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")

EXTRAS = {
    **dict.fromkeys(("OpenGL", "av", "jinja2", "matplotlib", "mpl_toolkits", "pyarrow", "pyrender", "trimesh"), "sim"),
    **dict.fromkeys(("drjit", "mitsuba"), "traced"),
    **dict.fromkeys(("skimage", "sklearn"), "train"),
    **dict.fromkeys(("fsspec", "s3fs"), "cloud"),
    "distributed": "distributed",
    "evo": "evo",
    "mcap": "ros",
    "pandas": "pandas",
    **dict.fromkeys(("chess_corners", "locus", "pupil_apriltags", "ringgrid"), "compare"),
    "plotly": "view",
    "pycolmap": "vlfeat",
    "rerun": "rerun",
    "rosbags": "ros",
}
"""Module → the extra of peakmark that brings it."""


def how_to_install(error: ImportError) -> str | None:
    """Return in one line what to install for an import that failed; None where no extra brings it.

    >>> how_to_install(ModuleNotFoundError("No module named 'av'", name="av.video"))
    "this needs av: pip install 'peakmark[sim]'"
    """
    library = (error.name or "").partition(".")[0]
    return f"this needs {library}: pip install 'peakmark[{EXTRAS[library]}]'" if library in EXTRAS else None


def needs_extra(function: Callable[P, R]) -> Callable[P, R]:
    """Let a function that imports a library of an extra say, where that is missing, what to install.

    The `ModuleNotFoundError` that it raises stays one, with the library's name; its text is `how_to_install`'s.
    """
    if isgeneratorfunction(function):

        @wraps(function)
        def generate(*arguments: P.args, **named: P.kwargs) -> Any:
            with _telling():
                yield from function(*arguments, **named)

        return generate

    @wraps(function)
    def call(*arguments: P.args, **named: P.kwargs) -> R:
        with _telling():
            return function(*arguments, **named)

    return call


@contextmanager
def _telling() -> Iterator[None]:
    try:
        yield
    except ModuleNotFoundError as error:
        told = how_to_install(error)
        if told is None:
            raise
        raise ModuleNotFoundError(told, name=error.name, path=error.path) from None
