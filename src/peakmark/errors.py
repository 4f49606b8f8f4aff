"""The exceptions a user can meet, as one small tree, and the line in which they are told.

::

    ValueError
    └── InputError            bad input: one line that names what was expected and what came
        ├── SceneError        a scene, trajectory or configuration file (raised by peaksim)
        └── ImageError        an image that cannot be read, or is too large to be honest
    RuntimeError
    ├── NativeError           the compiled kernels are missing, damaged or for another machine (raised by peaksim)
    └── RendererError         the renderer failed, the input was fine (raised by peaksim)

Commands print an `InputError` or a `NativeError` as one line and exit with status 2, a `RendererError` with status 3.
"""

from peaksim.errors import ImageError, InputError, NativeError, RendererError, SceneError, check_choice

__all__ = ["ImageError", "InputError", "NativeError", "RendererError", "SceneError", "check_choice", "one_line"]


def one_line(text: str) -> str:
    r"""Return text as one line that is safe to print: characters that a terminal would obey are escaped.

    >>> one_line("red \x1b[31m\nalert")
    'red \\x1b[31m alert'
    """
    line = " ".join(text.split())
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in line)
