"""The interface of a store of a corpus."""

import io
from collections.abc import Iterable, Iterator
from contextlib import AbstractContextManager
from hashlib import sha256
from typing import IO, Any, Protocol

from peaksim.corpus.layout import _SAFE


class Writing(io.BufferedIOBase):
    """A file being written, which knows the SHA-256 of what went in."""

    def __init__(self, file: IO[bytes]) -> None:
        self._file = file
        self._hash = sha256()

    def writable(self) -> bool:
        """Return True."""
        return True

    def write(self, content: Any) -> int:
        """Append bytes."""
        self._hash.update(content)
        return self._file.write(content)

    def tell(self) -> int:
        """Return how many bytes went in."""
        return self._file.tell()

    @property
    def sha256(self) -> str:
        """Of everything written so far, as 64 hexadecimal digits."""
        return self._hash.hexdigest()


class Store(Protocol):
    """Named files; names are relative, with slashes."""

    url: str
    """As the user gave it."""

    def create(self, name: str, *, lasting: bool = True) -> AbstractContextManager[Writing]:
        """Yield a binary file to write in a `with` block; it appears under its name when the block ends well.

        From then on it survives a loss of power; one that is not `lasting` does so from the next `settle` on.
        """

    def settle(self, names: Iterable[str]) -> None:
        """Make files survive a loss of power; many at once take little longer than one."""

    def read(self, name: str, most: int | None = None) -> bytes:
        """Return a file's content, raising InputError where it is missing or has more than so many bytes."""

    def sha256(self, name: str) -> str:
        """Return a file's hash, reading it piece by piece."""

    def exists(self, name: str) -> bool:
        """Return whether a file is there."""

    def names(self, prefix: str = "") -> Iterator[str]:
        """Yield the names of all files below a folder ("a/b/"), in no particular order."""

    def alone(self) -> AbstractContextManager[None]:
        """Exclude other runs during a `with` block, where that is possible."""


def write_file(store: Store, name: str, content: bytes, *, lasting: bool = True) -> str:
    """Write a whole file and return its SHA-256; see `Store.create`."""
    with store.create(name, lasting=lasting) as file:
        file.write(content)
    return file.sha256


def is_safe(name: str) -> bool:
    """Return whether a name stays inside the folder: plain characters, no part that starts with a dot."""
    return _SAFE.fullmatch(name) is not None


def limited(content: bytes, most: int | None) -> bytes:
    """Return what was read, refusing more than so many bytes."""
    if most is not None and len(content) > most:
        raise OSError(f"is larger than {most} bytes")
    return content
