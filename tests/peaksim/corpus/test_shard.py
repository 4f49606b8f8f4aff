"""Shards: the webdataset package reads them, and their bytes depend on their content alone."""

import hashlib
from pathlib import Path

import pytest
from peaksim.corpus.shard import read_members, shard_in

from tests.peaksim.corpus.helpers import MemoryFile

SAMPLES = {"00000007.png": b"picture", "00000007.json": b"{}\n", "00000008.png": b"", "00000008.json": b"[]\n" * 999}


def tar(samples: dict[str, bytes]) -> bytes:
    file = MemoryFile()
    with shard_in(file) as shard:
        for name, content in samples.items():
            shard.add(name, content)
    assert file.sha256 == hashlib.sha256(file.buffer.getvalue()).hexdigest()
    return file.buffer.getvalue()


def test_members_come_back_in_order() -> None:
    assert list(read_members(tar(SAMPLES), "x.tar").items()) == list(SAMPLES.items())


def test_the_bytes_hold_no_time_and_no_owner() -> None:
    assert tar(SAMPLES) == tar(SAMPLES)
    assert hashlib.sha256(tar(SAMPLES)).hexdigest() == PINNED


def test_webdataset_reads_a_shard(tmp_path: Path) -> None:
    webdataset = pytest.importorskip("webdataset")
    (tmp_path / "000000.tar").write_bytes(tar(SAMPLES))
    samples = list(webdataset.WebDataset(str(tmp_path / "000000.tar"), shardshuffle=False))
    assert [sample["__key__"] for sample in samples] == ["00000007", "00000008"]
    assert samples[0]["png"] == b"picture"
    assert samples[1]["json"] == SAMPLES["00000008.json"]


def test_an_unfinished_shard_is_not_closed() -> None:
    file = MemoryFile()

    class Stop(Exception):
        pass

    def stopped() -> None:
        with shard_in(file) as shard:
            shard.add("a.png", b"x")
            raise Stop

    with pytest.raises(Stop):
        stopped()
    assert len(file.buffer.getvalue()) < len(tar({"a.png": b"x"}))


PINNED = "37a2cf6c9c6e156f6cca780d6a6e7445d8fb79a41f8eff91d648aec5fba1c0ad"
