"""The exceptions a user can meet, as one small tree.

::

    ValueError
    └── InputError            bad input: one line that names what was expected and what came
        ├── SceneError        a scene, trajectory or configuration file (raised by peaksim)
        └── ImageError        an image that cannot be read, or is too large to be honest
    RuntimeError
    └── RendererError         the renderer failed, the input was fine (raised by peaksim)

Commands print an `InputError` as one line and exit with status 2, a `RendererError` with status 3.
"""

from peaksim.errors import ImageError, InputError, RendererError, SceneError, check_choice

__all__ = ["ImageError", "InputError", "RendererError", "SceneError", "check_choice"]
