"""Reading a corpus: images and records by frame number, from loose files or from shards."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from numpy.typing import NDArray

from peaksim.corpus import layout
from peaksim.corpus.configuration import Configuration, read_configuration
from peaksim.corpus.sample import Record, decode_image
from peaksim.corpus.shard import read_members
from peaksim.corpus.store.base import Store
from peaksim.corpus.store.opening import open_store
from peaksim.corpus.write import read_records
from peaksim.errors import InputError


@dataclass(frozen=True)
class Corpus:
    """An opened corpus; frames are read on demand."""

    store: Store
    """Its files."""
    configuration: Configuration
    """What made it."""

    def __len__(self) -> int:
        return self.configuration.spec.frames

    def records(self) -> Iterator[Record]:
        """Yield every frame's record, in order."""
        for shard in range(layout.shard_count(self.configuration.spec)):
            yield from read_records(self.store, shard)

    def record(self, frame: int) -> Record:
        """Return a frame's record.

        Raises
        ------
        InputError
            If there is no such frame.
        """
        spec = self.configuration.spec
        if not 0 <= frame < spec.frames:
            raise InputError(f"{self.store.url}: frame: expected 0…{spec.frames - 1}, got {frame}")
        shard = frame // spec.store.shard_frames
        return list(read_records(self.store, shard))[frame % spec.store.shard_frames]

    def picture(self, frame: int) -> NDArray[Any]:
        """Return a frame's image, (H, W) grey or (H, W, 3) RGB; uint16 after a sensor of more than 8 bits.

        Raises
        ------
        ImageError
            If it is damaged.
        """
        spec = self.configuration.spec
        name = layout.image_name(spec, frame)
        if spec.store.files:
            return decode_image(self.store.read(name), name)
        key = name.rpartition("/")[2]
        shard = _shard(self.store.url, layout.shard_name(frame // spec.store.shard_frames))
        if key not in shard:
            raise InputError(f"{self.store.url}: expected {key} in a shard, it is not there")
        return decode_image(shard[key], name)


@lru_cache(maxsize=1)
def _shard(url: str, name: str) -> dict[str, bytes]:
    return read_members(open_store(url).read(name), f"{url}: {name}")


def open_corpus(dest: str) -> Corpus:
    """Open a finished corpus.

    Raises
    ------
    InputError
        If there is none, or it is unfinished.
    """
    store = open_store(dest)
    configuration = read_configuration(store)
    if not store.exists(layout.MANIFEST):
        raise InputError(f"{dest}: expected a finished corpus, this one has no manifest yet: make it to its end first")
    return Corpus(store, configuration)
