"""The exceptions of the simulator; `peakmark.errors` draws the whole tree."""

from collections.abc import Iterable


class InputError(ValueError):
    """Input that cannot be used; the message names the field or file, what was expected and what came."""


class SceneError(InputError):
    """A scene, camera, trajectory or configuration that cannot be used."""


class ImageError(InputError):
    """An image or texture that cannot be read, or is larger than the stated limit."""


class RendererError(RuntimeError):
    """The renderer failed although the input was valid (no GL context, a lost context)."""


class NativeError(RuntimeError):
    """The library of kernels is missing, damaged, or for another machine; the message says what to do."""


def check_choice(value: object, choices: Iterable[str], name: str) -> None:
    """Refuse what is not one of some words.

    Raises
    ------
    InputError
        That names the argument and the words.
    """
    words = tuple(choices)
    if not isinstance(value, str) or value not in words:
        raise InputError(f"{name}: expected one of {', '.join(words)}, got {value!r}")
