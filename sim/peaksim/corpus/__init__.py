"""Corpora: annotated image sets of any size from one specification and one seed; CORPUS.md defines them on disk.

::

    spec.toml ─▶ spec ─▶ plan (pure, by frame index) ─▶ sample (image + record) ─▶ store
                                                              shards, then parts, then the manifest

`make_corpus` writes one, `open_corpus` reads one, `check_corpus` verifies one.
"""

from typing import TYPE_CHECKING

from peaksim.lazy import lazy_names

if TYPE_CHECKING:
    from peaksim.corpus.backends import in_process as in_process
    from peaksim.corpus.backends import on_dask as on_dask
    from peaksim.corpus.backends import processes as processes
    from peaksim.corpus.check import check_corpus as check_corpus
    from peaksim.corpus.make import make_corpus as make_corpus
    from peaksim.corpus.read import open_corpus as open_corpus
    from peaksim.corpus.spec import CorpusSpec as CorpusSpec
    from peaksim.corpus.spec import load_spec as load_spec

__all__, __getattr__, __dir__ = lazy_names(
    __name__,
    {
        **dict.fromkeys(("CorpusSpec", "load_spec"), "peaksim.corpus.spec"),
        **dict.fromkeys(("in_process", "on_dask", "processes"), "peaksim.corpus.backends"),
        "check_corpus": "peaksim.corpus.check",
        "make_corpus": "peaksim.corpus.make",
        "open_corpus": "peaksim.corpus.read",
    },
)
