"""Where a corpus is kept: a folder, or a bucket behind an fsspec URL such as s3://bucket/name.

A file appears under its name whole or not at all: in a folder by writing elsewhere and renaming; in a bucket because
an object exists only once its upload is complete.
"""

from peaksim.corpus.store.base import Store
from peaksim.corpus.store.bucket import BucketStore
from peaksim.corpus.store.folder import FolderStore


def open_store(dest: str, *, new: bool = False) -> Store:
    """Open a folder or bucket; `new` makes a folder that is missing.

    Raises
    ------
    InputError
        One line: it is missing, not a folder, or cannot be reached or written.
    """
    return BucketStore(dest) if "://" in dest else FolderStore(dest, new=new)
