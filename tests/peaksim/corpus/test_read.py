"""Reading: the same images and records whether they lie loose or in shards."""

from pathlib import Path

import numpy as np
import pytest
from peaksim.corpus import make_corpus, open_corpus
from peaksim.corpus.plan import plan_frame
from peaksim.corpus.sample import render_frame
from peaksim.errors import InputError

from tests.peaksim.corpus.helpers import tiny_spec


@pytest.mark.parametrize("store", [{"files": False}, {"shards": False}], ids=str)
def test_what_is_read_is_what_was_rendered(folder: Path, tmp_path: Path, store: dict[str, bool]) -> None:
    spec = tiny_spec(frames=7, store={"shard_frames": 3, "part_frames": 6, **store})
    make_corpus(spec, folder, str(tmp_path / "c"))
    corpus = open_corpus(str(tmp_path / "c"))
    assert len(corpus) == 7
    assert [record["frame"] for record in corpus.records()] == list(range(7))
    for frame in (0, 5, 6):
        plan = plan_frame(spec, folder, frame)
        assert np.array_equal(corpus.picture(frame), render_frame(plan, "exact").image)
        assert corpus.record(frame)["world_from_camera"] == plan.world_from_camera.tolist()
    for wrong in (-1, 7):
        with pytest.raises(InputError, match=f"frame: expected 0…6, got {wrong}"):
            corpus.record(wrong)


@pytest.mark.parametrize("content", [b"rot", b"x" * 1024, b""])
def test_a_damaged_shard_is_one_line(folder: Path, tmp_path: Path, content: bytes) -> None:
    make_corpus(tiny_spec(frames=2, store={"files": False}), folder, str(tmp_path / "c"))
    (tmp_path / "c" / "shards" / "000000.tar").write_bytes(content)
    with pytest.raises(InputError, match=r"shards/000000\.tar: expected a tar file|expected 00000000\.png in a shard"):
        open_corpus(str(tmp_path / "c")).picture(0)


def test_a_record_of_any_depth_is_one_line(folder: Path, tmp_path: Path) -> None:
    make_corpus(tiny_spec(frames=1), folder, str(tmp_path / "c"))
    (tmp_path / "c" / "records" / "000000.jsonl").write_bytes(b"[" * 200_000 + b"\n")
    with pytest.raises(InputError, match=r"records/000000\.jsonl: expected one line of JSON"):
        open_corpus(str(tmp_path / "c")).record(0)
