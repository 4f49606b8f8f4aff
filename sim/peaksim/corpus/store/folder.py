"""A corpus in a folder."""

import os
import shutil
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from hashlib import file_digest
from pathlib import Path

from peaksim.corpus.store.base import Writing, is_safe, limited
from peaksim.errors import InputError
from peaksim.folder_lock import lock_folder
from peaksim.threads import map_in_threads

_UNFINISHED = ".unfinished"
_SYNCS = 16  # files that are synced at once


class FolderStore:
    """A corpus in a folder of this machine, or of a file system that all workers share."""

    def __init__(self, dest: str, *, new: bool) -> None:
        self.url = dest
        self.root = Path(dest)
        with self._reported(""):
            if self.root.exists() and not self.root.is_dir():
                raise InputError(f"{dest}: expected a folder, found a file")
            if not self.root.exists() and not new:
                raise InputError(f"{dest}: expected a corpus, found nothing there")
            self.root.mkdir(parents=True, exist_ok=True)

    @contextmanager
    def create(self, name: str, *, lasting: bool = True) -> Iterator[Writing]:
        """Yield a file; it is synced if `lasting` and renamed to its name when the block ends without an exception.

        Unlike `peaksim.whole_file` it writes in a folder of its own under a unique name: workers of several machines
        may write one file at a time, and what a killed run leaves is cleared without a look at the finished files.
        """
        target = self._path(name)
        with self._reported(name):
            (self.root / _UNFINISHED).mkdir(exist_ok=True)
            handle, path = tempfile.mkstemp(dir=self.root / _UNFINISHED)
            try:
                with os.fdopen(handle, "wb") as file:
                    yield Writing(file)
                    file.flush()
                    os.chmod(path, 0o644)
                    if lasting:
                        os.fsync(file.fileno())
                target.parent.mkdir(parents=True, exist_ok=True)
                os.replace(path, target)
            finally:
                Path(path).unlink(missing_ok=True)

    def settle(self, names: Iterable[str]) -> None:
        """Sync files in parallel: a disk then writes many at once."""

        def sync(name: str) -> None:
            with self._reported(name), self._path(name).open("rb") as file:
                os.fsync(file.fileno())

        map_in_threads(sync, names, _SYNCS)

    def read(self, name: str, most: int | None = None) -> bytes:
        """Return a file's content, at most so many bytes."""
        with self._reported(name), self._path(name).open("rb") as file:
            return limited(file.read() if most is None else file.read(most + 1), most)

    def sha256(self, name: str) -> str:
        """Return a file's hash."""
        with self._reported(name), self._path(name).open("rb") as file:
            return file_digest(file, "sha256").hexdigest()

    def exists(self, name: str) -> bool:
        """Return whether a file is there."""
        with self._reported(name):
            return self._path(name).is_file()

    def names(self, prefix: str = "") -> Iterator[str]:
        """Yield the names of all files below a folder; unfinished files are left out."""
        with self._reported(prefix):
            for folder, _, files in os.walk(self.root / prefix, onerror=_raise_unless_missing):
                relative = Path(folder).relative_to(self.root)
                if relative.parts[:1] != (_UNFINISHED,):
                    yield from ((relative / file).as_posix() for file in files)

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Exclude other runs, and clear what a killed run left unfinished; the kernel frees the lock in any case."""
        with self._reported(""):
            try:
                handle = lock_folder(self.root.resolve(), wait=False)
            except BlockingIOError as error:
                raise InputError(f"{self.url}: expected a folder that no other run writes to, one does") from error
        try:
            self.clear()
            yield
            self.clear()
        finally:
            os.close(handle)

    def clear(self) -> None:
        """Delete unfinished files."""
        shutil.rmtree(self.root / _UNFINISHED, ignore_errors=True)

    def _path(self, name: str) -> Path:
        if not is_safe(name):
            raise InputError(f"{self.url}: expected a plain file name, got {name!r}")
        return self.root / name

    @contextmanager
    def _reported(self, name: str) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise InputError(f"{self.url}: {name or 'folder'}: {error.strerror or error}") from error


def _raise_unless_missing(error: OSError) -> None:
    """Report a folder that cannot be listed: its files would seem to be missing."""
    if not isinstance(error, FileNotFoundError):
        raise error
