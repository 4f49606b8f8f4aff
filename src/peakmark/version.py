"""Which version this is."""

from importlib.metadata import PackageNotFoundError, version


def _installed() -> str:
    try:
        return version("peakmark")
    except PackageNotFoundError:  # a checkout that is on the path, but not installed
        return "unknown"


__version__ = _installed()
