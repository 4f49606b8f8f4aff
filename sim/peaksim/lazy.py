"""Packages whose public names are imported when first used (PEP 562), so that importing the package stays quick."""

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any


def lazy_names(
    package: str, homes: Mapping[str, str]
) -> tuple[list[str], Callable[[str], Any], Callable[[], list[str]]]:
    """Return a package's `__all__`, `__getattr__` and `__dir__`.

    Parameters
    ----------
    package
        Its dotted name.
    homes
        Public name → the module that it is imported from; a module that has no such name is itself meant.
    """

    def get(name: str) -> Any:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        module = import_module(homes[name])
        return getattr(module, name, module)

    return sorted(homes), get, lambda: sorted(homes)
