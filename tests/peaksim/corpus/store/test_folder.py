"""Folders: files appear whole or not at all, names stay inside, full disks are one line, two runs do not mix."""

import hashlib
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from peaksim.corpus import check_corpus, make_corpus, open_corpus
from peaksim.corpus.store.base import write_file
from peaksim.corpus.store.opening import open_store
from peaksim.errors import InputError

from tests.peaksim.corpus.helpers import tiny_spec


def test_what_is_written_is_read_and_listed(tmp_path: Path) -> None:
    store = open_store(str(tmp_path / "new" / "er"), new=True)
    digest = write_file(store, "a/b/c.txt", b"hello")
    write_file(store, "top.txt", b"")
    assert digest == hashlib.sha256(b"hello").hexdigest()
    assert store.read("a/b/c.txt") == b"hello"
    assert store.exists("a/b/c.txt")
    assert not store.exists("a/b")
    assert sorted(store.names()) == ["a/b/c.txt", "top.txt"]
    assert list(store.names("a/")) == ["a/b/c.txt"]
    assert list(store.names("none/")) == []


def test_files_settle_many_at_once_and_a_missing_one_is_named(tmp_path: Path) -> None:
    store = open_store(str(tmp_path))
    names = [f"a/{k}" for k in range(40)]
    for name in names:
        assert write_file(store, name, name.encode(), lasting=False) == hashlib.sha256(name.encode()).hexdigest()
    assert sorted(store.names()) == sorted(names)
    with settled() as synced:
        store.settle(names)
    assert sorted(synced) == sorted(str(tmp_path / name) for name in names)
    with pytest.raises(InputError, match=r"a/40: No such file"):
        store.settle([*names, "a/40"])


@contextmanager
def settled() -> Iterator[list[str]]:
    """Collect the paths of the files that are synced in the block."""
    synced: list[str] = []

    def note(handle: int) -> None:
        synced.append(os.readlink(f"/proc/self/fd/{handle}"))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fsync", note)
        yield synced


def test_a_shard_is_sealed_when_its_frames_have_settled(folder: Path, tmp_path: Path) -> None:
    with settled() as synced:
        make_corpus(tiny_spec(), folder, str(tmp_path / "c"))
    where = {path: number for number, path in enumerate(synced)}
    seals = [k for k, path in enumerate(synced) if "/.unfinished/" in path]
    frames = sorted((tmp_path / "c" / "frames").rglob("*.*"))
    assert len(frames) == 24
    assert all(str(frame) in where for frame in frames)
    for shard in range(4):
        last = max(where[str(frame)] for frame in frames if frame.parent.name == f"{shard:06d}")
        assert any(last < seal < last + 2 for seal in seals)  # the next thing that is synced is the shard's sums


def test_an_exception_while_writing_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    store = open_store(str(tmp_path))
    write_file(store, "x.txt", b"old")

    def fail() -> None:
        with store.create("x.txt") as file:
            file.write(b"new")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fail()
    assert store.read("x.txt") == b"old"
    assert list(store.names()) == ["x.txt"]
    assert not list((tmp_path / ".unfinished").iterdir())


@pytest.mark.parametrize("name", ["../up", "a/../../up", "/etc/passwd", ".hidden", "a//b", "a\nb", "<b>", "a'b", ""])
def test_names_that_could_lead_elsewhere_are_refused(tmp_path: Path, name: str) -> None:
    store = open_store(str(tmp_path / "in"), new=True)
    with pytest.raises(InputError, match="expected a plain file name"):
        write_file(store, name, b"x")
    with pytest.raises(InputError, match="expected a plain file name"):
        store.read(name)
    assert [p.name for p in tmp_path.iterdir()] == ["in"]


def test_what_is_missing_or_no_folder_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="nothing: expected a corpus, found nothing there"):
        open_store(str(tmp_path / "nothing"))
    (tmp_path / "file").write_text("x")
    with pytest.raises(InputError, match="expected a folder, found a file"):
        open_store(str(tmp_path / "file"), new=True)
    with pytest.raises(InputError, match=r"gone\.txt: No such file"):
        open_store(str(tmp_path)).read("gone.txt")


def test_a_folder_with_spaces_quotes_and_html_is_a_folder_like_any_other(tmp_path: Path) -> None:
    store = open_store(str(tmp_path / 'it\'s a "<b>" folder'), new=True)
    write_file(store, "x", b"1")
    assert store.read("x") == b"1"


@pytest.mark.parametrize("form", ["file://{}", "file:{}", "file://localhost{}", "local://{}"])
def test_a_url_of_a_folder_is_that_folder(folder: Path, tmp_path: Path, form: str) -> None:
    dest = form.format(tmp_path / "new" / "a%20b")
    make_corpus(tiny_spec(frames=2), folder, dest)
    assert check_corpus(dest) == []
    assert open_corpus(dest).picture(1).shape == (48, 64)
    assert (tmp_path / "new" / "a b" / "manifest.json").is_file()


@pytest.mark.parametrize("url", ["file://host/x", "file:///x?y", "file:///x#y", "file://"])
def test_a_url_of_no_folder_here_is_one_line(url: str) -> None:
    with pytest.raises(InputError, match=r"expected the URL of a folder on this machine, such as file:///"):
        open_store(url, new=True)


def test_a_name_that_no_folder_can_have_and_one_that_cannot_be_listed_are_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(InputError, match="folder: File name too long"):
        open_store(str(tmp_path / ("x" * 300)), new=True)
    store = open_store(str(tmp_path))
    (tmp_path / "frames").mkdir()
    monkeypatch.setattr(os, "scandir", refuse)
    with pytest.raises(InputError, match=r"folder: Permission denied"):
        list(store.names())


def refuse(path: object) -> None:
    raise PermissionError(13, "Permission denied")


def test_a_full_disk_is_one_line_and_leaves_no_torn_file(tmp_path: Path) -> None:
    store = open_store(str(tmp_path))
    (tmp_path / ".unfinished").symlink_to("/dev/full")  # a device on which nothing can be written
    with pytest.raises(InputError, match=r"x\.bin: "):
        write_file(store, "x.bin", b"y")
    assert not store.exists("x.bin")


def test_a_second_run_is_kept_out_until_the_first_ends_and_leftovers_are_cleared(tmp_path: Path) -> None:
    store, other = open_store(str(tmp_path)), open_store(str(tmp_path))
    (tmp_path / ".unfinished").mkdir()
    (tmp_path / ".unfinished" / "torn").write_bytes(b"half a pic")
    with store.alone():
        assert not (tmp_path / ".unfinished").exists()
        with pytest.raises(InputError, match="no other run writes to, one does"), other.alone():
            pass
    with other.alone():
        pass
