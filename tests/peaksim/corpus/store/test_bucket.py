"""Buckets: a corpus in S3, from a server of its own on this machine, is the corpus in a folder, byte for byte."""

from collections.abc import Iterator
from pathlib import Path
from urllib.request import Request, urlopen

import pytest
from peaksim.corpus import check_corpus, make_corpus, open_corpus, processes
from peaksim.corpus.store.base import write_file
from peaksim.corpus.store.opening import open_store
from peaksim.errors import InputError

from tests.peaksim.corpus.helpers import contents, tiny_spec

pytest.importorskip("s3fs")
server = pytest.importorskip("moto.server")


@pytest.fixture
def s3(monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """The address of an empty S3 server with a bucket "corpora"; s3fs finds it by the environment."""
    import boto3

    moto = server.ThreadedMotoServer(ip_address="127.0.0.1", port=0)
    moto.start()
    host, port = moto.get_host_and_port()
    url = f"http://{host}:{port}"
    for name, value in (
        ("AWS_ENDPOINT_URL", url),
        ("AWS_ACCESS_KEY_ID", "key"),
        ("AWS_SECRET_ACCESS_KEY", "secret"),
        ("AWS_DEFAULT_REGION", "us-east-1"),
    ):
        monkeypatch.setenv(name, value)
    boto3.client("s3", endpoint_url=url).create_bucket(Bucket="corpora")
    yield url
    moto.stop()


def test_a_corpus_in_a_bucket_has_the_bytes_of_one_in_a_folder(folder: Path, tmp_path: Path, s3: str) -> None:
    spec = tiny_spec(frames=6)
    make_corpus(spec, folder, str(tmp_path / "c"))
    made = make_corpus(spec, folder, "s3://corpora/a b/tiny", processes(1))
    assert made.rendered == 6
    store = open_store("s3://corpora/a b/tiny")
    assert {name: store.read(name) for name in store.names()} == contents(tmp_path / "c")
    assert check_corpus("s3://corpora/a b/tiny") == []
    assert open_corpus("s3://corpora/a b/tiny").picture(3).shape == (48, 64)
    assert make_corpus(spec, folder, "s3://corpora/a b/tiny").rendered == 0
    with pytest.raises(InputError, match=r"spec\.seed is 5 there and 9 here"):
        make_corpus(tiny_spec(frames=6, seed=9), folder, "s3://corpora/a b/tiny")


@pytest.mark.slow
def test_lost_objects_are_made_again(folder: Path, tmp_path: Path, s3: str) -> None:
    import fsspec

    make_corpus(tiny_spec(), folder, str(tmp_path / "c"))
    make_corpus(tiny_spec(), folder, "s3://corpora/tiny")
    fs = fsspec.filesystem("s3")
    lost = (
        "manifest.json",
        "sums/part-000001.sha256",
        "sums/shard-000002.sha256",
        "frames/000002/00000007.png",
        "shards/000002.tar",
    )
    fs.rm([f"corpora/tiny/{name}" for name in lost])
    assert make_corpus(tiny_spec(), folder, "s3://corpora/tiny").rendered == 1
    store = open_store("s3://corpora/tiny")
    assert {name: store.read(name) for name in store.names()} == contents(tmp_path / "c")


def test_an_upload_that_breaks_off_leaves_no_object(s3: str) -> None:
    store = open_store("s3://corpora/x")

    def fail() -> None:
        with store.create("half") as file:
            file.write(b"half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fail()
    assert list(store.names()) == []


def test_a_bucket_that_is_missing_or_forbidden_is_one_line(
    folder: Path, s3: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(InputError, match=r"s3://nowhere/tiny: .*bucket does not exist") as caught:
        make_corpus(tiny_spec(), folder, "s3://nowhere/tiny")
    assert "\n" not in str(caught.value)
    monkeypatch.setenv("AWS_ENDPOINT_URL", "http://127.0.0.1:9")  # nobody listens there
    with pytest.raises(InputError, match=r"s3://corpora/tiny: "):
        write_file(open_store("s3://corpora/tiny"), "x", b"x")


def test_a_user_without_rights_is_told_in_one_line(folder: Path, s3: str) -> None:
    """The server is told to check its users from now on; it knows none."""

    def check_users_after(requests: bytes) -> None:
        urlopen(Request(f"{s3}/moto-api/reset-auth", requests, {"Content-Type": "text/plain"}), timeout=30).close()

    check_users_after(b"0")
    try:
        with pytest.raises(InputError, match=r"s3://corpora/tiny: corpus\.json: (Forbidden|.*Access)") as caught:
            make_corpus(tiny_spec(), folder, "s3://corpora/tiny")
        assert "\n" not in str(caught.value)
    finally:
        check_users_after(b"inf")


@pytest.mark.parametrize("url", ["nosuch://bucket/x", "memory"])
def test_an_unknown_kind_of_url_is_one_line(url: str) -> None:
    if url == "memory":
        store = open_store("memory://corpora/x")
        write_file(store, "a/b", b"1")
        assert (store.read("a/b"), list(store.names())) == (b"1", ["a/b"])
        return
    with pytest.raises(InputError, match="nosuch"):
        open_store(url)
