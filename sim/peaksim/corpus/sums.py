"""Lists of check sums, as sha256sum writes them, and what is wrong with the files that they name."""

import re
from collections.abc import Collection

from peaksim.corpus.store.base import Store, is_safe
from peaksim.errors import InputError

LARGEST_LIST = 1 << 28
"""Bytes of the largest list or manifest that is read; a part of a million shards has 100 MB."""

_LINE = re.compile(r"([0-9a-f]{64})  (.+)")

Entry = tuple[str, str | None]
"""A file's name, and its SHA-256 where a list has it."""

Faults = dict[str, str]
"""Name of a file → what is wrong with it."""


def parse_sums(content: bytes) -> tuple[list[Entry], str | None]:
    """Return the (name, SHA-256) pairs of a list, and what is wrong with its other lines."""
    lines = content.decode("utf-8", "replace").removesuffix("\n").split("\n")
    found = [_LINE.fullmatch(line) for line in lines]
    broken = [i for i, match in enumerate(found) if match is None]
    fault = None
    if broken:
        more = f" (and {len(broken) - 1} more)" if len(broken) > 1 else ""
        fault = f"line {broken[0] + 1}: expected a check sum and a name, got {lines[broken[0]][:40]!r}{more}"
    return [(match[2], match[1]) for match in found if match is not None], fault


def read_sums(store: Store, name: str) -> tuple[list[Entry], str | None]:
    """Return what `parse_sums` does of a file; one that cannot be read has no pairs."""
    try:
        return parse_sums(store.read(name, LARGEST_LIST))
    except InputError as error:
        return [], str(error)


def file_fault(store: Store, name: str, digest: str | None) -> str | None:
    """Return what is wrong with a file, None if it is as it was written; no digest: only whether it is there."""
    if not is_safe(name):
        return "is not a plain file name"
    try:
        if not store.exists(name):
            return "is missing"
        if digest is not None and store.sha256(name) != digest:
            return "is not what was written"
    except InputError as error:
        return f"cannot be read: {error}"
    return None


def sealed_faults(store: Store, sums_name: str, expected: Collection[str]) -> Faults:
    """Return what is wrong with the files of a finished shard or part, whose names are known, and with its sums."""
    pairs, broken = read_sums(store, sums_name)
    listed = dict(pairs)
    faults: Faults = {} if broken is None else {sums_name: broken}
    if others := sorted(listed.keys() - set(expected)):
        faults[sums_name] = f"lists {others[0]!r:.80}, which does not belong there"
    for name in expected:
        fault = file_fault(store, name, listed[name]) if name in listed else f"is not listed in {sums_name!r}"
        if fault is not None:
            faults[name] = fault
    return faults


def lines_of(faults: Faults) -> tuple[str, ...]:
    """Return one line for each fault."""
    return tuple(f"{name!r}: {fault}" for name, fault in faults.items())
