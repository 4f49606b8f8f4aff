"""check_corpus: every file against its check sum, and no other files."""

import json
from collections.abc import Callable, Iterator
from hashlib import sha256

from peaksim.corpus import layout
from peaksim.corpus.read import Corpus, open_corpus
from peaksim.corpus.store.base import is_safe
from peaksim.errors import InputError

OTHERS = "detections/"
"""Folder of a corpus in which results about it may lie; they are not checked."""


def check_corpus(dest: str, on_file: Callable[[], None] = lambda: None) -> list[str]:
    """Return what is wrong with a corpus, one line a fault; an empty list means that every byte is as it was written.

    Raises
    ------
    InputError
        If there is no finished corpus at all.
    """
    corpus = open_corpus(dest)
    faults, seen = [], {layout.MANIFEST}
    for name, digest in _listed(corpus):
        seen.add(name)
        on_file()
        fault = _fault(corpus, name, digest)
        if fault is not None:
            faults.append(fault)
    extra = (name for name in corpus.store.names() if name not in seen and not name.startswith(OTHERS))
    return faults + [f"{name!r}: is not of the corpus" for name in sorted(extra)]


def _listed(corpus: Corpus) -> Iterator[tuple[str, str]]:
    """Yield (name, SHA-256) of every file, following lists of sums to the lists that they name."""
    pending = list(_manifest(corpus).items())
    while pending:
        name, digest = pending.pop()
        yield name, digest
        if name.startswith("sums/") and corpus.store.exists(name):
            pending += sums_of(corpus.store.read(name), name)


def _manifest(corpus: Corpus) -> dict[str, str]:
    try:
        listed = json.loads(corpus.store.read(layout.MANIFEST))["sha256"]
        return {str(name): str(digest) for name, digest in listed.items()}
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        where = f"{corpus.store.url}: {layout.MANIFEST}"
        raise InputError(f"{where}: expected the manifest of a corpus: {error!r:.80}") from error


def sums_of(content: bytes, name: str) -> list[tuple[str, str]]:
    """Return the (name, SHA-256) pairs of a file of check sums.

    Raises
    ------
    InputError
        If a line is not one.
    """
    pairs = []
    for line in content.decode("utf-8", "replace").splitlines():
        digest, gap, file = line.partition("  ")
        if not gap or len(digest) != 64:
            raise InputError(f"{name}: expected lines of check sums, got {line[:40]!r}")
        pairs.append((file, digest))
    return pairs


def _fault(corpus: Corpus, name: str, digest: str) -> str | None:
    if not is_safe(name):
        return f"{name!r}: is not a plain file name"
    if not corpus.store.exists(name):
        return f"{name!r}: is missing"
    if sha256(corpus.store.read(name)).hexdigest() != digest:
        return f"{name!r}: is not what was written"
    return None
