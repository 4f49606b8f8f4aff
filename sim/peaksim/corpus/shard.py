"""WebDataset shards: tar files with NAME.png and NAME.json for each frame, always of the same bytes."""

import tarfile
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from typing import IO, cast

from peaksim.corpus.store.base import Writing
from peaksim.errors import InputError


class Shard:
    """A tar file being written; members have no owner and no time of day."""

    def __init__(self, file: Writing) -> None:
        self._tar = tarfile.TarFile(fileobj=cast(IO[bytes], file), mode="w", format=tarfile.USTAR_FORMAT)

    def add(self, name: str, content: bytes) -> None:
        """Append a member."""
        info = tarfile.TarInfo(name)
        info.size, info.mode = len(content), 0o644
        self._tar.addfile(info, BytesIO(content))

    def close(self) -> None:
        """Write the end of the archive."""
        self._tar.close()


@contextmanager
def shard_in(file: Writing) -> Iterator[Shard]:
    """Yield a shard that is closed when the block ends without an exception."""
    shard = Shard(file)
    yield shard
    shard.close()


def read_members(content: bytes, name: str) -> dict[str, bytes]:
    """Return the members of a shard by name, in order.

    Raises
    ------
    InputError
        That names the shard, if it is damaged.
    """
    try:
        with tarfile.TarFile(fileobj=BytesIO(content), mode="r") as tar:
            return {info.name: tar.extractfile(info).read() for info in tar if info.isfile()}  # type: ignore[union-attr]
    except tarfile.TarError as error:
        raise InputError(f"{name}: expected a tar file, it is damaged: {error}") from error
