"""Where a corpus is kept: a folder or a bucket, behind one interface."""

from peaksim.corpus.store.base import Store
from peaksim.corpus.store.opening import open_store

__all__ = ["Store", "open_store"]
