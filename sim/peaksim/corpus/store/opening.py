"""Where a corpus is kept: a folder, or a bucket behind an fsspec URL such as s3://bucket/name.

A file appears under its name whole or not at all: in a folder by writing elsewhere and renaming; in a bucket because
an object exists only once its upload is complete.
"""

import re
from urllib.parse import urlsplit
from urllib.request import url2pathname

from peaksim.corpus.store.base import Store
from peaksim.corpus.store.bucket import BucketStore
from peaksim.corpus.store.folder import FolderStore
from peaksim.errors import InputError


def open_store(dest: str, *, new: bool = False) -> Store:
    """Open a folder or bucket; `new` makes a folder that is missing.

    Raises
    ------
    InputError
        One line: it is missing, not a folder, or cannot be reached or written.
    """
    if not re.match("(file|local):/", dest):
        return BucketStore(dest) if "://" in dest else FolderStore(dest, new=new)
    url = urlsplit(dest)
    if url.netloc not in ("", "localhost") or url.query or url.fragment or not url.path:
        raise InputError(f"{dest}: expected the URL of a folder on this machine, such as file:///home/me/corpus")
    return FolderStore(url2pathname(url.path), new=new)
