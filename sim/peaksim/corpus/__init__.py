"""Corpora: annotated image sets of any size from one specification and one seed; CORPUS.md defines them on disk.

::

    spec.toml ─▶ spec ─▶ plan (pure, by frame index) ─▶ sample (picture + record) ─▶ store
                                                              shards, then parts, then the manifest

`make_corpus` writes one, `open_corpus` reads one, `check_corpus` verifies one.
"""

from importlib import import_module
from typing import Any

_HOMES = {
    "CorpusSpec": "spec",
    "check_corpus": "check",
    "in_process": "backends",
    "load_spec": "spec",
    "make_corpus": "make",
    "on_dask": "backends",
    "open_corpus": "read",
    "processes": "backends",
}

__all__ = list(_HOMES)


def __getattr__(name: str) -> Any:
    """Import a public name's module on first use (PEP 562)."""
    if name not in _HOMES:
        raise AttributeError(f"module 'peaksim.corpus' has no attribute {name!r}")
    return getattr(import_module(f"peaksim.corpus.{_HOMES[name]}"), name)
