"""The exceptions of the simulator; `peakmark.errors` draws the whole tree."""


class InputError(ValueError):
    """Input that cannot be used; the message names the field or file, what was expected and what came."""


class SceneError(InputError):
    """A scene, camera, trajectory or configuration that cannot be used."""


class ImageError(InputError):
    """An image or texture that cannot be read, or is larger than the stated limit."""


class RendererError(RuntimeError):
    """The renderer failed although the input was valid (no GL context, a lost context)."""
