"""A corpus behind any fsspec URL; the extra "cloud" brings fsspec and s3fs."""

import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from hashlib import file_digest
from typing import Any

from peaksim.corpus.store.base import Writing, is_safe, limited
from peaksim.errors import InputError


class BucketStore:
    """Objects below one prefix."""

    def __init__(self, dest: str) -> None:
        self.url = dest
        self._fs, root = _file_system(dest)
        self._root = root.rstrip("/")

    @contextmanager
    def create(self, name: str, *, lasting: bool = True) -> Iterator[Writing]:
        """Yield a local file; it is uploaded when the block ends without an exception, and lasting then."""
        path = self._path(name)
        with tempfile.NamedTemporaryFile() as file:
            yield Writing(file)
            file.flush()
            with self._reported(name):
                self._fs.put_file(file.name, path)

    def settle(self, names: Iterable[str]) -> None:
        """Do nothing: what is uploaded lasts."""

    def read(self, name: str, most: int | None = None) -> bytes:
        """Return an object's content, at most so many bytes."""
        with self._reported(name):
            end = None if most is None else most + 1
            return limited(bytes(self._fs.cat_file(self._path(name), end=end)), most)

    def sha256(self, name: str) -> str:
        """Return an object's hash."""
        with self._reported(name), self._fs.open(self._path(name), "rb") as file:
            return file_digest(file, "sha256").hexdigest()

    def exists(self, name: str) -> bool:
        """Return whether an object is there."""
        with self._reported(name):
            self._fs.invalidate_cache()
            return bool(self._fs.exists(self._path(name)))

    def names(self, prefix: str = "") -> Iterator[str]:
        """Yield the names of all objects below a prefix."""
        with self._reported(prefix):
            self._fs.invalidate_cache()
            found = self._fs.find(f"{self._root}/{prefix}")
        yield from (path.removeprefix(f"{self._root}/") for path in found)

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Do nothing: buckets have no locks, and two runs with one configuration write the same bytes."""
        yield

    def _path(self, name: str) -> str:
        if not is_safe(name):
            raise InputError(f"{self.url}: expected a plain file name, got {name!r}")
        return f"{self._root}/{name}"

    @contextmanager
    def _reported(self, name: str) -> Iterator[None]:
        try:
            yield
        except Exception as error:  # every backend has its own exceptions
            raise InputError(f"{self.url}: {name or 'bucket'}: {_reason(error)}") from error


def _file_system(dest: str) -> tuple[Any, str]:
    """Return fsspec's file system of a URL, and the path in it."""
    try:
        import fsspec
    except ImportError as error:
        raise InputError(f"{dest}: needs fsspec: pip install 'peakmark[cloud]'") from error
    try:
        fs, path = fsspec.core.url_to_fs(dest, use_listings_cache=False, skip_instance_cache=True)
    except (ImportError, ValueError) as error:
        raise InputError(f"{dest}: {_reason(error)}") from error
    return fs, str(path)


def _reason(error: BaseException) -> str:
    return " ".join(str(error).split())[:200] or type(error).__name__
