"""check_corpus: every file against its check sum, every list against the specification, and no other files."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from peaksim.corpus import layout
from peaksim.corpus.configuration import Configuration, manifest_values, read_configuration, to_json, versions
from peaksim.corpus.inputs import compare_inputs
from peaksim.corpus.read import open_corpus
from peaksim.corpus.spec import CorpusSpec
from peaksim.corpus.store.base import Store, is_safe
from peaksim.corpus.store.opening import open_store
from peaksim.corpus.sums import LARGEST_LIST, Entry, file_fault, read_sums
from peaksim.errors import InputError

OTHERS = "detections/"
"""Folder of a corpus in which results about it may lie; they are not checked."""


def check_corpus(dest: str, on_file: Callable[[], None] = lambda: None, folder: Path | None = None) -> list[str]:
    """Return what is wrong with a corpus, one line a fault; an empty list means that every byte is as it was written.

    Parameters
    ----------
    dest
        Its folder or URL.
    on_file
        Called for each file.
    folder
        Where the specification's files are, to compare them with the hashes that corpus.json lists.

    Raises
    ------
    InputError
        If there is no finished corpus at all.
    """
    store = open_store(dest)
    if not store.exists(layout.MANIFEST):
        open_corpus(dest)  # says what is there instead
    content = store.read(layout.MANIFEST, LARGEST_LIST)
    hashes = _hashes(content, store.url)
    configuration = _configuration(store, hashes)
    walk = _Walk(store, None if configuration is None else configuration.spec, on_file)
    walk.follow(hashes)
    extra = (name for name in store.names() if name not in walk.seen and not name.startswith(OTHERS))
    faults = walk.faults + [f"{name!r}: is not of the corpus" for name in sorted(extra)]
    if configuration is not None:
        faults = _manifest_faults(content, hashes, configuration) + faults + _compared(configuration, folder)[0]
    return faults


def unchecked_inputs(dest: str, folder: Path | None = None) -> list[str]:
    """Return the names of the input files that `check_corpus` cannot compare, since they are not here."""
    return _compared(read_configuration(open_store(dest)), folder)[1]


def _compared(configuration: Configuration, folder: Path | None) -> tuple[list[str], list[str]]:
    same = configuration.versions.get("peakmark") == versions(configuration.renderer).get("peakmark")
    return compare_inputs(configuration.spec, configuration.inputs, folder, same_version=same)


def _hashes(content: bytes, url: str) -> dict[str, str]:
    try:
        return {str(name): str(digest) for name, digest in json.loads(content)["sha256"].items()}
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        where = f"{url}: {layout.MANIFEST}"
        raise InputError(f"{where}: expected the manifest of a corpus: {error!r:.80}") from error


def _configuration(store: Store, hashes: dict[str, str]) -> Configuration | None:
    """Return corpus.json, None if it is missing or is not what was written, which is a fault like others."""
    digest = hashes.get(layout.CONFIGURATION)
    damaged = digest is not None and file_fault(store, layout.CONFIGURATION, digest) is not None
    return None if damaged else read_configuration(store)


def _manifest_faults(content: bytes, hashes: dict[str, str], configuration: Configuration) -> list[str]:
    """Return the fields of the manifest that are not as corpus.json, for which it vouches, has them."""
    names = layout.manifest_files(configuration.spec)
    wanted = manifest_values(configuration, {name: hashes[name] for name in names if name in hashes})
    there: dict[str, Any] = {**json.loads(content), "sha256": wanted["sha256"]}
    faults = [
        f"{layout.MANIFEST!r}: {field!r:.40} is {there.get(field)!r:.60}, "
        f"{layout.CONFIGURATION!r} says {wanted.get(field)!r:.60}"
        for field in {**wanted, **there}
        if field not in there or field not in wanted or there[field] != wanted[field]
    ]
    if not faults and hashes.keys() == set(names) and content != to_json(wanted):
        return [f"{layout.MANIFEST!r}: is not what was written"]
    return faults


class _Walk:
    """Visits every file once, from the manifest to the lists that it names and so on, whatever they say."""

    def __init__(self, store: Store, spec: CorpusSpec | None, on_file: Callable[[], None]) -> None:
        self._store, self._spec, self._on_file = store, spec, on_file
        self.faults: list[str] = []
        self.seen: dict[str, str | None] = {layout.MANIFEST: None}

    def follow(self, hashes: dict[str, str]) -> None:
        """Visit what the manifest lists."""
        pending = self._entries(layout.MANIFEST, list(hashes.items()))
        while pending:
            name, digest = pending.pop()
            if name in self.seen:
                if digest not in (None, self.seen[name]):
                    self.faults.append(f"{name!r}: is listed again with another check sum")
                continue
            self.seen[name] = digest
            self._on_file()
            fault = file_fault(self._store, name, digest)
            if fault is not None:
                self.faults.append(f"{name!r}: {fault}")
            if name.startswith("sums/") and is_safe(name):
                pending += self._listed(name)

    def _listed(self, name: str) -> list[Entry]:
        if not self._store.exists(name):
            return self._entries(name, [])
        pairs, broken = read_sums(self._store, name)
        if broken is not None:
            self.faults.append(f"{name!r}: {broken}")
        return self._entries(name, pairs)

    def _entries(self, name: str, pairs: list[Entry]) -> list[Entry]:
        """Return what a list names, and what it should name; differences are faults."""
        expected = set(layout.listed_in(self._spec, name)) if self._spec is not None else set()
        listed = {file for file, _ in pairs}
        if expected and pairs:
            self.faults += [f"{file!r}: is not listed in {name!r}" for file in sorted(expected - listed)]
            others = (file for file in sorted(listed - expected) if is_safe(file))
            self.faults += [f"{file!r}: is listed in {name!r}, where it does not belong" for file in others]
        return pairs + [(file, None) for file in expected - listed]
