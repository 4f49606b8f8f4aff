"""How every experiment gets through its items: those that its journal has are not done again, the others as they come.

Items are independent of each other; a record depends on the configuration and the item alone, so that neither the
number of workers nor an interruption changes it.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from peaksim.corpus.backends import in_process, processes

from peakmark.experiments.journal import Journal
from peakmark.plain import to_plain

OnStep = Callable[[int, int], None]
"""Called with the numbers of finished and of all items: once before the first, and after each that is done."""


def run_items(
    journal: Journal,
    names: Sequence[str],
    work: Callable[[int], Any],
    workers: int = 1,
    on_step: OnStep = lambda done, of: None,
) -> list[Any]:
    """Return the records of all items, in the order of their names, each of which stands once.

    `work` makes a record from an index into `names`, in so many processes (1 is this one; for more, any process must be
    able to import it). The journal keeps each, as plain values, as soon as there is one.

    Raises
    ------
    InputError
        If the number of workers is not in 1…1024, and what `work` raises.
    """
    missing = [index for index, name in enumerate(names) if name not in journal.records]
    backend = in_process() if workers == 1 else processes(workers)
    done = len(names) - len(missing)
    on_step(done, len(names))
    for index, record in backend.run(partial(_numbered, work), missing):
        journal.add(names[index], record)
        done += 1
        on_step(done, len(names))
    return [journal.records[name] for name in names]


def _numbered(work: Callable[[int], Any], index: int) -> tuple[int, Any]:
    return index, to_plain(work(index))
